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

import gc
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from hsp_control.common.version import __version__ as __version__

if TYPE_CHECKING:  # for type checkers; the names are looked up below
    from . import config as config
    from . import live as live
    from . import robot as robot
    from . import simulation as simulation
    from . import tasks as tasks
    from . import trajectories as trajectories
    from .common import exceptions as errors  # noqa: F401 (a namespace)
    from .common.exceptions import HspControlError as HspControlError
    from .companions import cameras as cameras
    from .companions import datagrams as datagrams
    from .companions import film as film
    from .companions import franka as franka
    from .companions import franka_box as franka_box
    from .companions import inspection as inspection
    from .companions import mujoco as mujoco
    from .companions import play as play
    from .companions import plots as plots
    from .companions import rerun as rerun
    from .companions import ros2 as ros2
    from .companions import simulators as simulators
    from .companions import sweeps as sweeps
    from .companions import viewer as viewer
    from .companions import walking as walking
    from .config import Experiment as Experiment
    from .config import Recorder as Recorder
    from .config import load_experiment as load_experiment
    from .constraints import contacts as contacts
    from .constraints import limits as limits
    from .constraints.limits import Barrier as Barrier
    from .constraints.limits import Limits as Limits
    from .control import Controller as Controller
    from .control import ControlOutput as ControlOutput
    from .control import changes as changes
    from .control import compensation as compensation
    from .control import estimator as estimation  # noqa: F401 (a namespace)
    from .control import motion_plan as plans  # noqa: F401 (a namespace)
    from .frozen import freeze as freeze
    from .geometry import Obstacle as Obstacle
    from .geometry import Sphere as Sphere
    from .geometry import shapes as shapes
    from .live import run_loop as run_loop
    from .null_space import fields as fields
    from .null_space import metrics as metrics
    from .null_space.fields import Cost as Cost
    from .null_space.fields import FunctionCost as FunctionCost
    from .null_space.fields import JointCentering as JointCentering
    from .null_space.fields import Manipulability as Manipulability
    from .null_space.fields import NullSpaceField as NullSpaceField
    from .null_space.fields import ObstacleClearance as ObstacleClearance
    from .null_space.fields import Rest as Rest
    from .null_space.fields import SelfClearance as SelfClearance
    from .null_space.fields import TargetPosture as TargetPosture
    from .robot import Robot as Robot
    from .robot import RobotState as RobotState
    from .robot import integrators as integrators
    from .simulation import Rollout as Rollout
    from .simulation import plants as plants
    from .simulation.simulate import simulate as simulate
    from .tasks import CenterOfMass as CenterOfMass
    from .tasks import FrameOrientation as FrameOrientation
    from .tasks import FramePose as FramePose
    from .tasks import FramePosition as FramePosition
    from .tasks import FunctionTask as FunctionTask
    from .tasks import Gains as Gains
    from .tasks import Impedance as Impedance
    from .tasks import JointPosture as JointPosture
    from .tasks import Pointing as Pointing
    from .tasks import Task as Task
    from .trajectories import Circle as Circle
    from .trajectories import Hold as Hold
    from .trajectories import Line as Line
    from .trajectories import Stream as Stream
    from .trajectories import StreamOrientation as StreamOrientation
    from .trajectories import StreamPose as StreamPose

_NAMES = {
    "robot": "Robot RobotState",
    "geometry": "Obstacle Sphere",
    "trajectories": "Circle Hold Line Stream StreamOrientation StreamPose",
    "tasks": (
        "CenterOfMass FrameOrientation FramePose FramePosition FunctionTask Gains "
        "Impedance JointPosture Pointing Task"
    ),
    "null_space.fields": (
        "Cost FunctionCost JointCentering Manipulability NullSpaceField "
        "ObstacleClearance Rest SelfClearance TargetPosture"
    ),
    "constraints.limits": "Barrier Limits",
    "control": "ControlOutput Controller",
    "simulation": "Rollout",
    "simulation.simulate": "simulate",
    "live": "run_loop",
    "frozen": "freeze",
    "config": "Experiment Recorder load_experiment",
    "common.exceptions": "HspControlError",
}
"""The public names, by the module from which they are imported at first use."""

_NAMESPACES = {
    "changes": "control.changes",
    "compensation": "control.compensation",
    "config": "config",
    "contacts": "constraints.contacts",
    "errors": "common.exceptions",
    "estimation": "control.estimator",
    "fields": "null_space.fields",
    "integrators": "robot.integrators",
    "limits": "constraints.limits",
    "live": "live",
    "metrics": "null_space.metrics",
    "plans": "control.motion_plan",
    "plants": "simulation.plants",
    "robot": "robot",
    "shapes": "geometry.shapes",
    "simulation": "simulation",
    "tasks": "tasks",
    "trajectories": "trajectories",
}
"""The public namespaces, and the modules that they stand for."""

_HOMES = {name: room for room, names in _NAMES.items() for name in names.split()}

__all__ = ["__version__", *_HOMES, *_NAMESPACES]


def __getattr__(name: str) -> Any:
    """Return a public name or namespace, imported at its first use (PEP 562)."""
    if name in _NAMESPACES:
        value: Any = _room(_NAMESPACES[name])
    elif name in _HOMES:
        value = getattr(_room(_HOMES[name]), name)
    elif name in _companions():
        value = _room(f"companions.{name}")
    else:
        raise AttributeError(
            f"module {__name__!r} has no attribute {name!r}{_hint(name)}"
        )
    globals()[name] = value
    return value


def _room(name: str) -> ModuleType:
    """Import a room without collecting garbage: imports create none."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        return import_module(f"{__name__}.{name}")
    finally:
        if collecting:
            gc.enable()


def _hint(name: str) -> str:
    """Return where a name is that a namespace has, for the message."""
    if name.startswith("_") or (Path(__file__).parent / name).is_dir():
        return ""  # a layer: importing it from here looks it up here first
    for namespace, room in _NAMESPACES.items():
        value = getattr(import_module(f"{__name__}.{room}"), name, None)
        if getattr(value, "__module__", "").startswith(f"{__name__}.{room}"):
            return f"; there is hsp_control.{namespace}.{name}"
    return ""


def _companions() -> list[str]:
    """Return the names of the companions that are there."""
    folder = Path(__file__).parent / "companions"
    return sorted(each.parent.name for each in folder.glob("*/__init__.py"))


def __dir__() -> list[str]:
    return sorted({*__all__, *_companions()})
