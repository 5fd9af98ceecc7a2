"""Constraints: contacts with the world, and limits of motors, joints and distances."""
