"""Estimation of a walking robot's unmeasured states from measured ones."""
