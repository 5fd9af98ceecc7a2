"""Sweeps: run one experiment many times with different values."""

from hsp_control.common.public_names import public_names

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
