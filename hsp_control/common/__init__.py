"""What all rooms use: array types, errors, linear algebra and compiled kernels."""
