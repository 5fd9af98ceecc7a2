"""What every plant in MuJoCo needs of it: its module, its warnings, its contacts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ModelError, SimulationError
from hsp_control.robot.description.mujoco import constants


def import_mujoco() -> Any:
    """Return the module ``mujoco``; its warnings go to our log, not to a file.

    Raises:
        SimulationError: If it is not installed.
    """
    try:
        return constants.import_mujoco()
    except ModelError as error:
        raise SimulationError(f"the plant cannot be made: {error}") from error


def check_motion(data: Any, end: float) -> None:
    """Check that a motion has not diverged.

    Args:
        data: MuJoCo's data.
        end: The time it was to reach [s], for the message.

    Raises:
        SimulationError: If MuJoCo found a number that is not finite, or very large.
    """
    kinds = import_mujoco().mjtWarning
    bad = (
        kinds.mjWARN_BADQPOS,
        kinds.mjWARN_BADQVEL,
        kinds.mjWARN_BADQACC,
        kinds.mjWARN_BADCTRL,  # which MuJoCo replaces by zero
    )
    if any(data.warning[kind].number for kind in bad):
        raise SimulationError(
            f"the motion diverged before t = {end:.6g} s: MuJoCo's state, acceleration "
            "or control is not finite, or beyond 1e10"
        )


def contact_wrenches(
    model: Any,
    data: Any,
    owners: Mapping[int, str],
    origins: Mapping[str, Array],
) -> dict[str, Array]:
    """Return the wrench of all contacts on each owner, shape (6,), in world axes.

    Args:
        model: MuJoCo's model.
        data: MuJoCo's data, after ``mj_forward``.
        owners: The owner of each geom that counts; contacts between two of the same
            owner cancel.
        origins: The point of each owner about which its moment is, shape (3,) [m].
    """
    mujoco = import_mujoco()
    wrenches = {name: np.zeros(6) for name in origins}
    local = np.zeros(6)
    for k, contact in enumerate(data.contact[: data.ncon]):
        touched = [(-1.0, contact.geom1), (1.0, contact.geom2)]
        hits = [(sign, owners[geom]) for sign, geom in touched if geom in owners]
        if not hits:
            continue
        mujoco.mj_contactForce(model, data, k, local)
        # From the first geom on the second, along the rows of contact.frame.
        rows = contact.frame.reshape(3, 3)
        for sign, name in hits:
            force, moment = sign * rows.T @ local[:3], sign * rows.T @ local[3:]
            # Ten times faster than np.cross.
            (x, y, z), (a, b, c) = contact.pos - origins[name], force
            wrenches[name][:3] += force
            wrenches[name][3:] += moment
            wrenches[name][3:] += y * c - z * b, z * a - x * c, x * b - y * a
    return wrenches
