"""Metrics: the numbers that summarise a run."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log_series import (
    column_unit,
    distances,
    effort_unit,
    task_errors,
)


class Measure(NamedTuple):
    """A number that summarises a run.

    Attributes:
        value: The number.
        unit: Its unit; a dash if it has none.
        meaning: A short description.
    """

    value: float
    unit: str
    meaning: str


def measures(rollout: Rollout) -> dict[str, Measure]:
    """Return the metrics of a run, by the names of a sweep's columns.

    For a run that ended early they are computed until its end; ``simulated_time`` is
    the time until then.
    """
    if not len(rollout):
        return {}
    found: dict[str, Measure] = {}

    def add(name: str, value: float, unit: str, meaning: str) -> None:
        found[name] = Measure(float(value), unit, meaning)

    for part in task_errors(rollout):
        name = f"tracking.{part.label.replace(' ', '.')}"
        what, norm = f"error of {part.label}", part.norm
        add(f"{name}.rms", _rms(norm), part.unit, f"rms {what}")
        add(f"{name}.max", norm.max(), part.unit, f"largest {what}")
        add(f"{name}.end", norm[-1], part.unit, f"{what} at the end")
    e_N, unit = rollout["null_space_norm"], column_unit(rollout, "null_space_norm")
    add("null_space_error.rms", _rms(e_N), unit, "rms null-space error")
    add("null_space_error.max", e_N.max(), unit, "largest null-space error")
    add("null_space_error.end", e_N[-1], unit, "null-space error at the end")
    least, values = rollout["manipulability"].min(), rollout["singular_values"]
    add("manipulability.min", least, "–", "minimum det(J W⁻¹ Jᵀ)")
    add("singular_value.min", values.min(), "–", "smallest singular value")
    damped = rollout["damped"].mean()
    add("damped.fraction", damped, "–", "fraction of time near a singularity")
    for field in distances(rollout):
        name, meaning = f"distance.{field}", f"minimum distance of {field}"
        add(f"{name}.min", rollout[name].min(), "m", meaning)
    tau, unit = rollout.tau, effort_unit(rollout)
    add("effort.max", np.abs(tau).max(), unit, "largest effort")
    rms = _rms(np.linalg.norm(tau, axis=1))
    add("effort.rms", rms, unit, "rms effort of all joints")
    speed, unit = np.abs(rollout.v).max(), column_unit(rollout, "v")
    add("speed.max", speed, unit, "largest joint speed")
    for name, of in ((POSITION, "position"), (VELOCITY, "speed")):
        if name in rollout.columns:
            most, unit = np.nan_to_num(rollout[name]).max(), column_unit(rollout, name)
            add(f"{name}.max", most, unit, f"farthest beyond a {of} limit")
    add("simulated_time", rollout.t[-1] - rollout.t[0], "s", "simulated time")
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
