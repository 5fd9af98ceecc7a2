"""What limits did to a run, and where the robot was beyond them."""

from collections.abc import Iterator

import numpy as np

from hsp_control.simulation import Rollout
from hsp_control.simulation.limit_excess import POSITION, VELOCITY


def limit_rows(rollout: Rollout) -> Iterator[str]:
    """Yield one sentence each; none where no limit was active and no joint beyond."""
    if POSITION not in rollout.columns:
        return
    status = rollout["status"]
    limited, relaxed = (int((status == s).sum()) for s in (2, 3))
    if limited or relaxed:
        yield f"{limited} rows limited of {len(rollout)}" + (
            f", {relaxed} relaxed by up to {np.nanmax(rollout['relaxation']):.3g}"
            if relaxed
            else ""
        )
    yield from excess_rows(rollout)


def excess_rows(rollout: Rollout) -> Iterator[str]:
    """Yield where the robot was beyond its limits, a sentence each."""
    if POSITION not in rollout.columns:
        return
    names = rollout.meta["robot"]["dofs"]
    for column, of, per in ((POSITION, "position", ""), (VELOCITY, "speed", "/s")):
        excess = rollout[column]
        if rows := int((excess > 0.0).any(axis=1).sum()):
            row, dof = np.unravel_index(np.nanargmax(excess), excess.shape)
            unit = rollout.meta["robot"]["units"][dof] + per
            yield (
                f"{names[dof]} is {excess[row, dof]:.3g} {unit} beyond its {of} limit "
                f"at {rollout.t[row]:g} s ({rows} rows): more than the model expected"
            )
