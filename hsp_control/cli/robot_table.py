"""The table of ``hsp robots``: every known robot, and the tasks that it can do."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.errors import ModelError
from hsp_control.common.resources import bundled_robots
from hsp_control.common.suggestions import listing
from hsp_control.robot import Robot
from hsp_control.robot.description.sources import (
    RobotSource,
    example_robots,
    examples_without_urdf,
    find_robot,
)

_BRAVO = {"bravo_finger1_joint": 0.0, "bravo_finger2_joint": 0.0}
LOAD_OPTIONS: dict[str, dict[str, Any]] = {
    "alex_psyonic_hands": {"mimic": False},
    "bluevolta_bravo7_gripper": {"locked": _BRAVO},
    "bravo7_gripper": {"locked": _BRAVO},
    "falcon_bravo7_gripper": {"locked": _BRAVO},
    "icub": {"locked": {"neck_yaw": 0.0}},
    "romeo": {"locked": {"LHand": 0.0, "RHand": 0.0}},
}
"""Options of `Robot.load` without which robots do not load, or cannot move."""

REMARKS = {
    "icub": "no mass moves with neck_yaw at its home",
    "talos_legs": "the URDF is the whole robot's",
    "ur3": "the URDF is a UR5's",
}
"""Notes on unexpected properties."""

FLOATING = "floating base: needs contacts"
NO_URDF = "has no URDF (only SDF, which is not read)"


@dataclass(frozen=True)
class RobotRow:
    """A robot in the table."""

    name: str
    origin: str  # ``bundled`` or ``example-robot-data``
    root: str  # connection of its root to the world
    nq: int | None = None  # numbers in a configuration; None if it does not load
    nv: int | None = None  # degrees of freedom
    frames: int | None = None
    end_effector: str = ""  # name of its end effector's frame
    joints: int = 0  # number of degrees of freedom that move the end effector
    position: int = 0  # rank of a position task (3 rows)
    pose: int = 0  # rank of a pose task (6 rows)
    note: str = ""  # a remark, or why the controller cannot be used


def count() -> int:
    """Return the number of rows, without loading a robot."""
    return len(_sources()) + len(list(examples_without_urdf()))


def _sources() -> dict[str, RobotSource]:
    sources = {name: find_robot(name) for name in bundled_robots()}
    return sources | {k: v for k, v in example_robots().items() if k not in sources}


def rows() -> Iterator[RobotRow]:
    """Yield every robot: bundled ones, usable ones, then the others."""
    sources = _sources()
    for floating in (False, True):
        for name, source in sources.items():
            if (source.root == "free_flyer") == floating:
                yield _row(name, source)
    for name in examples_without_urdf():
        yield RobotRow(name, "example-robot-data", "-", note=NO_URDF)


def text(found: Sequence[RobotRow]) -> Iterator[str]:
    """Yield the table's lines, of at most 80 characters."""
    headings = ("nv", "end effector", "position", "pose")
    for origin in dict.fromkeys(row.origin for row in found):
        yield _line(origin, *headings)
        for row in found:
            if row.origin != origin:
                continue
            tasks = task(row, row.position, 3), task(row, row.pose, 6)
            yield _line(row.name, number(row.nv), row.end_effector or "-", *tasks)
            note = row.note.replace("`", "")
            yield from textwrap.wrap(
                note, 76, initial_indent="    ", subsequent_indent="    "
            )
        yield ""


def _line(name: str, nv: str, end_effector: str, position: str, pose: str) -> str:
    return f"{name:27} {nv:>2}  {end_effector:29} {position:8}  {pose}".rstrip()


def task(row: RobotRow, rank: int, full: int) -> str:
    """Return rank and redundancy of a task, such as ``3 + 4``; ``-`` if impossible."""
    # A position task may omit axes, so any rank is enough; a pose task needs rank 6.
    if rank == 0 or (full == 6 and rank < full):
        return "-"
    return f"{rank} + {row.joints - rank}"


def _row(name: str, source: RobotSource) -> RobotRow:
    notes = [REMARKS[name]] if name in REMARKS else []
    if source.root == "free_flyer":
        notes.insert(0, FLOATING)
    try:
        robot = Robot.load(name)
    except ModelError as error:
        reason = str(error).removeprefix(f"{source.urdf}: ")
        reason = reason.removeprefix("Pinocchio cannot build a model: ")
        notes.append(reason.split("; ")[0].split(", so that")[0])
        if name not in LOAD_OPTIONS:
            return RobotRow(name, source.origin, source.root, note="; ".join(notes))
    if name in LOAD_OPTIONS:
        notes.append(f"load it with {_options(name)}")
        robot = Robot.load(name, **LOAD_OPTIONS[name])
    found: dict[str, Any] = {"end_effector": robot.end_effector}
    if source.root != "free_flyer":
        found |= abilities(robot)
    return RobotRow(
        *(name, source.origin, source.root),
        *(robot.nq, robot.nv, len(robot.frame_names)),
        note="; ".join(notes),
        **found,
    )


def _options(name: str) -> str:
    """Return the load options as written in a configuration."""
    options = []
    for key, value in LOAD_OPTIONS[name].items():
        if key == "locked":
            locks = [f"{joint}: {position:g}" for joint, position in value.items()]
            options.append(f"`locked: {{{listing(locks, limit=3)}}}`")
        else:
            options.append(f"`{key}: {str(value).lower()}`")
    return " and ".join(options)


def abilities(robot: Robot) -> dict[str, int]:
    """Return the number of joints that move the end effector, and the task ranks."""
    # A random configuration (limits may be missing) is almost surely not singular.
    spread = np.random.default_rng(0).uniform(-1.0, 1.0, robot.nv)
    q = robot.integrate(robot.home(), spread)
    J = robot.state(0.0, q, np.zeros(robot.nv)).frame(robot.end_effector).jacobian
    return {
        "joints": int((np.abs(J) > 1e-9).any(axis=0).sum()),
        "position": int(np.linalg.matrix_rank(J[:3], tol=1e-6)),
        "pose": int(np.linalg.matrix_rank(J, tol=1e-6)),
    }


def number(value: int | None) -> str:
    """Return a number as text; a dash for None."""
    return "-" if value is None else str(value)
