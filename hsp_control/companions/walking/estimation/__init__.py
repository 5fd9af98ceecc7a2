"""Estimation: what is not measured of a walking robot, from what is."""
