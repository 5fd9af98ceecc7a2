"""Robots out of compiled MuJoCo models; the package mujoco is imported when needed."""
