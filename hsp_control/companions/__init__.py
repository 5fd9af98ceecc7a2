"""Additions to the core, by type of user.

The core imports nothing from here. It finds a companion's additions by the entry points
in pyproject.toml: types of a configuration, commands of `hsp`, robots, formats. A
companion that is not needed can be deleted with its folder. In Python:
``hsp_control.walking.Walk``.
"""
