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
    for part in task_errors(rollout):
        name = f"tracking.{part.label.replace(' ', '.')}"
        what = f"error of {part.label}"
        found[f"{name}.rms"] = Measure(_rms(part.norm), part.unit, f"rms {what}")
        found[f"{name}.max"] = Measure(
            _maximum(part.norm), part.unit, f"largest {what}"
        )
        found[f"{name}.end"] = Measure(
            float(part.norm[-1]), part.unit, f"{what} at the end"
        )
    e_N = rollout["null_space_norm"]
    unit = column_unit(rollout, "null_space_norm")
    found["null_space_error.rms"] = Measure(_rms(e_N), unit, "rms null-space error")
    found["null_space_error.max"] = Measure(
        _maximum(e_N), unit, "largest null-space error"
    )
    found["null_space_error.end"] = Measure(
        float(e_N[-1]), unit, "null-space error at the end"
    )
    found["manipulability.min"] = Measure(
        _minimum(rollout["manipulability"]), "–", "minimum det(J W⁻¹ Jᵀ)"
    )
    found["singular_value.min"] = Measure(
        _minimum(rollout["singular_values"]), "–", "smallest singular value"
    )
    found["damped.fraction"] = Measure(
        float(np.mean(rollout["damped"])), "–", "fraction of time near a singularity"
    )
    for field in distances(rollout):
        found[f"distance.{field}.min"] = Measure(
            _minimum(rollout[f"distance.{field}"]), "m", f"minimum distance of {field}"
        )
    unit = effort_unit(rollout)
    found["effort.max"] = Measure(_maximum(np.abs(rollout.tau)), unit, "largest effort")
    found["effort.rms"] = Measure(
        _rms(np.linalg.norm(rollout.tau, axis=1)), unit, "rms effort of all joints"
    )
    unit = column_unit(rollout, "v")
    found["speed.max"] = Measure(
        _maximum(np.abs(rollout.v)), unit, "largest joint speed"
    )
    for name, of in ((POSITION, "position"), (VELOCITY, "speed")):
        if name in rollout.columns:
            unit = column_unit(rollout, name)
            most = _maximum(np.nan_to_num(rollout[name]))
            meaning = f"farthest beyond a {of} limit"
            found[f"{name}.max"] = Measure(most, unit, meaning)
    found["simulated_time"] = Measure(
        float(rollout.t[-1] - rollout.t[0]), "s", "simulated time"
    )
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _maximum(values: Array) -> float:
    return float(values.max())


def _minimum(values: Array) -> float:
    return float(values.min())
