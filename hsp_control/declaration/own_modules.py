"""The modules of a user's own whose types are in a configuration."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hsp_control.common.entry_points import entry_points
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.part import Part


def own_modules(parts: Any) -> Iterator[str]:
    """Yield modules that declare types of parts, and that can be imported.

    Modules of this package and of installed ones with entry points are found without a
    list, and a script would run once more: these are left out.
    """
    for part in _parts(parts):
        name = type(part).__module__
        if name.startswith("hsp_control.") or name == "__main__":
            continue
        family, yaml_type = part.family, part.yaml_type
        if family is not None and yaml_type in entry_points(family.name):
            continue
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None)
        if file is None:
            continue
        spec = getattr(module, "__spec__", None)
        installed = "." in name or (spec is not None and spec.name != Path(file).stem)
        yield name if installed else str(Path(file).resolve())


def _parts(value: Any) -> Iterator[Part]:
    """Yield a part and all parts inside it."""
    for part in parts_within(value, Part):
        yield part
        yield from _parts(part.all_fields())
