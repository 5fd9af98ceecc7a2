"""Constraints: contacts with the world, and limits of motors, joints and distances."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["contacts", "limits"])
