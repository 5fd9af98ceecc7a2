"""Used by all layers: array types, errors, entry points and resources."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["errors"])
