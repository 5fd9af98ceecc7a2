"""Additions to the core, by type of user.

The core imports nothing from here. It finds a companion's additions by the entry points
in pyproject.toml: types of a configuration, commands of `hsp`, robots, formats. A
companion that is not needed can be deleted with its folder. In Python:
``hsp_control.walking.Walk``.
"""

from pathlib import Path

import lazy_loader

_here = (file.parent.name for file in Path(__file__).parent.glob("*/__init__.py"))
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, _here)
