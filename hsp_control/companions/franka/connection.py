"""Connect to a Franka arm, check it, and apply the settings."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka import client
from hsp_control.companions.franka.client_process import ClientProcess
from hsp_control.companions.franka.hardware import FrankaHardware
from hsp_control.companions.franka.model_check import difference, postures
from hsp_control.companions.franka.reflexes import MODES, about
from hsp_control.companions.franka.settings import FrankaSettings
from hsp_control.declaration import within
from hsp_control.robot import Robot

_KERNEL = Path("/sys/kernel/realtime")
"""Contains 1 with a PREEMPT_RT kernel; libfranka reads it, too."""
_TIMEOUT = 20.0
"""Maximum time of connecting, including a recovery [s]."""


def connect(
    address: FrankaSettings | str, robot: Robot, period: float
) -> FrankaHardware:
    """Return the arm, ready for torque control; it does not move yet.

    Args:
        address: The settings, or ``ADDRESS?name=value&...`` (`FrankaSettings.parse`).
        robot: The controller's model: seven joints, the hand's fingers locked.
        period: The control period [s]: a millisecond.

    Raises:
        LiveError: If a setting is wrong.
        HardwareError: If the arm cannot be reached, is not ready or is not the arm of
            the model.
    """
    settings = FrankaSettings.parse(address) if isinstance(address, str) else address
    _check(robot, period)
    chosen = postures(robot)
    process, found = reached(settings, chosen, moves=True)
    gripper: ClientProcess | None = None
    try:
        q = np.vstack([found["q"], chosen])
        masses = np.array(found["masses"]).reshape(-1, 7, 7)
        models = difference(robot, q, masses, np.array(found["gravities"]))
        models.check(found["total"]["mass"])
        if settings.gripper is not None:
            host, port = settings.gripper.removeprefix("udp://").split(":")
            given = {"address": settings.address, "gripper": (host, int(port))}
            gripper = ClientProcess()
            with within("gripper"):
                gripper.asked(client.CONNECT + json.dumps(given).encode(), _TIMEOUT)
    except BaseException:
        process.close()
        if gripper is not None:
            gripper.close()
        raise
    lines = [
        f"The robot at {settings.address}: end effector "
        f"{found['end_effector']:.3g} kg (Desk), load "
        f"{found['load']['mass']:.3g} kg, {_realtime(settings)}",
        f"It stops at external efforts of {_listed(settings.collision_torque)} N·m "
        f"and forces of {_listed(settings.collision_force)} N and N·m",
        str(models)[0].upper() + str(models)[1:],
    ]
    return FrankaHardware(robot, process, settings, q[0], lines, gripper)


def reached(
    settings: FrankaSettings, chosen: Array, *, moves: bool
) -> tuple[ClientProcess, dict[str, Any]]:
    """Return a connection to an arm that is ready, and its reports (`client`).

    Args:
        settings: The settings to apply.
        chosen: Postures at which the robot's model is queried, shape (n, 7).
        moves: Whether the arm is to move; otherwise its collision behaviour stays.

    Raises:
        HardwareError: If the arm cannot be reached, or is not ready.
    """
    process = ClientProcess()
    try:
        found = process.asked(
            client.CONNECT + _wanted(settings, chosen, moves), _TIMEOUT
        )
        if found["mode"] != "Idle":
            errors = f" ({about(found['errors'])})" if found["errors"] else ""
            raise HardwareError(
                f"the robot is in mode {found['mode']}{errors}; "
                f"{MODES.get(found['mode'], 'it must be Idle')}"
            )
        _check_load(settings, found["load"])
    except BaseException:
        process.close()
        raise
    return process, found


def _listed(values: ArrayLike) -> str:
    return ", ".join(f"{each:g}" for each in np.ravel(values))


def _realtime(settings: FrankaSettings) -> str:
    if settings.realtime == "enforce":
        return "real-time kernel and priority enforced (kEnforce)"
    try:
        there = _KERNEL.read_text().strip() == "1"
    except OSError:
        there = False
    kernel = "real-time" if there else "not real-time: packets may be late"
    return f"real time not enforced (kIgnore); this kernel is {kernel}"


def _check(robot: Robot, period: float) -> None:
    if robot.nv != 7 or robot.nq != 7:
        raise HardwareError(
            f"{robot.name} has {robot.nv} degrees of freedom "
            f"({', '.join(robot.dof_names)}); a Franka arm has seven. Lock the "
            "fingers: robot: {name: ..., locked: {panda_finger_joint1: 0.02, ...}}"
        )
    if abs(period - FrankaHardware.period) > 1e-9:
        raise HardwareError(
            f"the control period is {period:g} s; a Franka takes an effort each 0.001 s"
        )


def _wanted(settings: FrankaSettings, chosen: Array, moves: bool) -> bytes:
    """Return the settings for the client, as JSON."""
    load = settings.load
    torque, force = settings.collision_torque, settings.collision_force
    thresholds = [np.asarray(each).tolist() for each in (torque, force)]
    return json.dumps(
        {
            "address": settings.address,
            "enforce": settings.realtime == "enforce",
            "recover": settings.recover,
            "collision": thresholds if moves else None,
            "load": None
            if load is None
            else {
                "mass": load.mass,
                "center": np.asarray(load.center).tolist(),
                "inertia": np.asarray(load.inertia).ravel().tolist(),
            },
            "postures": chosen.tolist(),
        }
    ).encode()


def _check_load(settings: FrankaSettings, found: dict[str, Any]) -> None:
    """Check that the robot reports the load that was sent.

    Raises:
        HardwareError: If it reports another one.
    """
    load = settings.load
    if load is None:
        return
    for name in ("mass", "center", "inertia"):
        sent = np.ravel(getattr(load, name))
        if not np.allclose(np.ravel(np.array(found[name])), sent, rtol=1e-5, atol=1e-6):
            raise HardwareError(
                f"the robot reports {name} {found[name]} of its load, and set_load "
                f"has sent {sent.tolist()}"
            )
