"""Kernels, what calls them, and Pinocchio's functions as calls."""
