"""MuJoCo's module, and its constants as integers."""

import importlib
import logging
from functools import cache
from types import SimpleNamespace
from typing import Any

from hsp_control.common.exceptions import ModelError

_log = logging.getLogger(__name__)


def import_mujoco() -> Any:
    """Return the module ``mujoco``; its warnings go to our log, not to a file."""
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError as error:
        raise ModelError(
            "a MuJoCo model needs MuJoCo, which is not installed; install it with: "
            "pip install 'hsp_control[mujoco]'"
        ) from error
    if mujoco.get_mju_user_warning() is None:  # otherwise MuJoCo writes a log file
        mujoco.set_mju_user_warning(_log.info)
    return mujoco


@cache
def constants(kind: str) -> Any:
    """Return the members of ``mjtJoint`` and so on, as integers: these compare."""
    members = getattr(import_mujoco(), kind).__members__
    return SimpleNamespace(**{name: int(value) for name, value in members.items()})
