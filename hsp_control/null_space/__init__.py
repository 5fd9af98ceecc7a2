"""Self-motion: null-space fields g with their rates g', and joint-space metrics W."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["fields", "metrics"])
