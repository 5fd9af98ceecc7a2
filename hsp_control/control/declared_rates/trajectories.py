"""User-defined rates of a trajectory, against differences in time.

A reference enters the error equation with its x' and x'': a wrong one drives the error
away as a disturbance does, and nothing else shows it.
"""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.declared_rates.comparison import (
    INTERVAL,
    Declared,
    declared_by,
    is_own,
)
from hsp_control.declaration import Part
from hsp_control.declaration.nested import parts_within
from hsp_control.trajectories import (
    CallableTrajectory,
    OrientationSample,
    OrientationTrajectory,
    PoseSample,
    PoseTrajectory,
    Trajectory,
    TrajectorySample,
)
from hsp_control.trajectories.crossfade import AnyReference

_AFTER = 0.0, 0.1, 0.3, 1.0, 3.0
"""Times after the present one at which it is checked [s]: many begin at rest."""
_WRITTEN_BY = "call", "calls", "sample"


def check_trajectories(parts: object, t: float) -> None:
    """Check the user-defined rates of the trajectories in parts, from t [s] on.

    Raises:
        RateError: If x', x'', ω or ω' is not the rate of its value.
    """
    for each in _within(parts):
        for by, value, rate in _declared(each):
            named = f"trajectory {type(each).__name__}"
            declared = Declared(named, by, value, rate, _of_coordinate)
            for first in (t + after for after in _AFTER):
                try:
                    samples = [_values(each, first + k * INTERVAL) for k in range(5)]
                except KeyboardInterrupt:
                    raise
                except BaseException:
                    break  # the step in which it occurs reports it
                values = np.array([sample[value] for sample in samples])
                declared.compare(values, samples[2][rate], first)


def _within(parts: object) -> Iterator[AnyReference]:
    """Yield all references in parts, those inside of others too."""
    for part in parts_within(parts, Part):
        if isinstance(part, Trajectory | OrientationTrajectory | PoseTrajectory):
            yield part
        yield from _within([*part.all_fields().values()])


def _declared(each: AnyReference) -> Iterator[tuple[str, str, str]]:
    """Yield the source of a rate of a reference, its value, and the rate, by name."""
    if isinstance(each, CallableTrajectory):
        if each.velocity is not None:
            yield "velocity", "x", "x'"
        if each.acceleration is not None:
            yield "acceleration", "x'", "x''"
    elif not is_own(type(each)):
        by = declared_by(each, _WRITTEN_BY)
        if not isinstance(each, OrientationTrajectory):
            yield by, "x", "x'"
            yield by, "x'", "x''"
        if not isinstance(each, Trajectory):
            yield by, "R", "[ω]× R"
            yield by, "ω", "ω'"


def _values(each: AnyReference, t: float) -> dict[str, Array]:
    """Return a reference's values at a time [s], by name."""
    sample = each.sample(t)
    found: dict[str, Array] = {}
    if isinstance(sample, PoseSample | TrajectorySample):
        point = sample.position if isinstance(sample, PoseSample) else sample
        found |= {"x": point.position, "x'": point.velocity, "x''": point.acceleration}
    if isinstance(sample, PoseSample | OrientationSample):
        turn = sample.orientation if isinstance(sample, PoseSample) else sample
        R, omega, omega_dot = turn
        # the columns of R turn with ω
        R_dot = np.cross(omega, R.T).T
        found |= {"R": R, "[ω]× R": R_dot, "ω": omega, "ω'": omega_dot}
    return {name: np.array(value, dtype=float).ravel() for name, value in found.items()}


def _of_coordinate(i: int) -> str:
    return f" of entry {i}"
