"""Used by all layers: array types, errors, entry points and resources."""
