"""Whole-body torque control with a null space that provably converges.

The law of Hsu, Hauser and Sastry (1989) on any URDF: the task error obeys
e'' + Kv e' + Kp e = 0 exactly, and the null-space velocity converges to the projection
of a field that may move in time.

The names that most programs need are here. All others are in namespaces:
``hsp.trajectories``, ``hsp.tasks``, ``hsp.fields``, ``hsp.metrics``, ``hsp.contacts``,
``hsp.limits``, ``hsp.shapes``, ``hsp.changes``, ``hsp.compensation``,
``hsp.integrators``, ``hsp.robot``, ``hsp.plans``, ``hsp.estimation``, ``hsp.plants``,
``hsp.simulation``, ``hsp.live``, ``hsp.config`` and ``hsp.errors``; and each companion
has one: ``hsp.viewer``, ``hsp.plots``, ``hsp.walking``, ``hsp.sweeps`` ...
"""

import re
from pathlib import Path
from types import ModuleType
from typing import Any

from hsp_control import companions
from hsp_control.common.public_names import public_names, unknown
from hsp_control.common.version import __version__ as __version__

_attribute, _, _names = public_names(__name__, __file__)
_stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_companions = {*re.findall(r"(?m)^from \.companions import (\w+)", _stub)}

# Those whose folders were deleted are still in the stub.
__all__ = sorted({*_names} - _companions)


def __dir__() -> list[str]:
    return sorted({*__all__, *companions.__all__})


def __getattr__(name: str) -> Any:
    """Return a public name or namespace, imported at its first use (PEP 562)."""
    if name in __dir__():
        return _attribute(name)
    raise unknown(__name__, name, _hint(name))


def _hint(name: str) -> str:
    """Return where a name is that a namespace has, for the message."""
    if name.startswith("_") or Path(__file__).with_name(name).is_dir():
        return ""  # a layer: importing it from here looks it up here first
    for space in __all__:
        module = __getattr__(space)
        home = getattr(getattr(module, name, None), "__module__", "")
        if isinstance(module, ModuleType) and home.startswith(module.__name__):
            return f"; there is {__name__}.{space}.{name}"
    return ""
