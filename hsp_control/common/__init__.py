"""What every room stands on: arrays, errors, linear algebra, compiled kernels."""
