"""Implausible values of a robot's description: findings with element and remedy."""

from hsp_control.common.public_names import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
