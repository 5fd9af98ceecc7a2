"""What every plant in MuJoCo needs of it: its module, its warnings, its contacts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ModelError, SimulationError
from hsp_control.common.kernels import kernel
from hsp_control.robot.mujoco import scene


def import_mujoco() -> Any:
    """Return the module ``mujoco``; its warnings go to our log, not to a file."""
    try:
        return scene.import_mujoco()
    except ModelError as error:
        raise SimulationError(f"the plant cannot be made: {error}") from error


def check_motion(data: Any, end: float) -> None:
    """Check that a motion has not diverged."""
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
    model: Any, data: Any, owners: Mapping[int, str], origins: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the wrench of all contacts on each owner, shape (6,), in world axes.

    ``owners`` are those of the geoms that count, contacts between two of one owner
    cancel; ``origins`` are the points about which their moments are.
    """
    mujoco, count = import_mujoco(), data.ncon
    names = list(origins)
    sums = np.zeros((len(names), 6))
    if count and names:
        index = np.full(model.ngeom, -1)
        for geom, name in owners.items():
            index[geom] = names.index(name)
        contact, local = data.contact, np.zeros((count, 6))
        touched = index[contact.geom]
        for k in np.flatnonzero((touched >= 0).any(axis=1)).tolist():
            mujoco.mj_contactForce(model, data, k, local[k])
        points = np.array([origins[name] for name in names])
        world = np.zeros(6)
        _add_wrenches(touched, contact.pos, contact.frame, local, points, world, sums)
    return dict(zip(names, sums, strict=True))


@kernel
def _add_wrenches(
    touched: Indices,
    positions: Array,
    frames: Array,
    local: Array,
    origins: Array,
    world: Array,
    sums: Array,
) -> None:
    """Add the wrench of each contact to those that it touches, about their origins."""
    for k in range(touched.shape[0]):
        for i in range(3):
            world[i] = world[3 + i] = 0.0
            for j in range(3):
                world[i] += frames[k, 3 * j + i] * local[k, j]
                world[3 + i] += frames[k, 3 * j + i] * local[k, 3 + j]
        for side in range(2):
            owner = touched[k, side]
            if owner < 0:
                continue
            sign = 1.0 if side == 1 else -1.0
            x = positions[k, 0] - origins[owner, 0]
            y = positions[k, 1] - origins[owner, 1]
            z = positions[k, 2] - origins[owner, 2]
            for i in range(6):
                sums[owner, i] += sign * world[i]
            sums[owner, 3] += sign * (y * world[2] - z * world[1])
            sums[owner, 4] += sign * (z * world[0] - x * world[2])
            sums[owner, 5] += sign * (x * world[1] - y * world[0])
