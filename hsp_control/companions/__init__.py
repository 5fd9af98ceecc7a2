"""What one kind of user needs, beside the core.

The core imports nothing from here. It finds what a companion adds by the entry points
in pyproject.toml: types of a configuration, commands of `hsp`, robots, formats. Whoever
does not want one deletes its folder. In Python: ``hsp_control.walking.Walk``.
"""
