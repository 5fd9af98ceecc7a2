"""What all rooms use: array types, errors, entry points and resources."""
