"""Series that are drawn, computed from a log: paths, distances, names, predictions.

A clearance measures between surfaces, which touch at zero. The paper's cost measures
from joints to an obstacle's centre: a joint is inside a ball below the ball's radius.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_meta import drawn_widths
from hsp_control.simulation.measures import distances


class TaskPath(NamedTuple):
    """The path of a point that a task controls."""

    name: str  # the task's name
    # the desired position [m], shape (N, 3); along world axes that the task does not
    # track, the actual one
    desired: Array
    actual: Array  # the actual position [m], shape (N, 3)
    axes: str  # the world axes that the task tracks, such as ``"xy"``


def drawn_parts(rollout: Rollout, name: str) -> dict[str, slice]:
    """Return the columns of a task's reference that can be drawn, by their quantity."""
    about = rollout.meta["tasks"][name]
    drawn = drawn_widths(about)
    ends = list(accumulate(drawn.values(), initial=0))
    return {part: slice(*ends[k : k + 2]) for k, part in enumerate(drawn)}


def task_path(rollout: Rollout, name: str) -> TaskPath | None:
    """Return the path of the point that a task controls, if it controls one."""
    where = drawn_parts(rollout, name).get("position")
    if where is None:
        return None
    actual = rollout[f"task.{name}.actual"][:, where]
    axes = rollout.meta["tasks"][name].get("axes") or "xyz"
    tracked, skeleton = ["xyz".index(axis) for axis in axes], rollout["skeleton"]
    path = np.zeros((len(actual), 3))
    path[:, tracked] = actual
    for point in range(skeleton.shape[1]):
        if np.array_equal(skeleton[:, point, tracked], actual):
            path = skeleton[:, point].copy()
    desired = path.copy()
    desired[:, tracked] = rollout[f"task.{name}.reference"][:, where]
    return TaskPath(name, desired, path, axes)


def finite_points(points: Array) -> Array:
    """Return the points that can be drawn, shape (K, 3): a log may have NaN in rows."""
    return points[np.isfinite(points).all(axis=1)]


def joint_names(rollout: Rollout) -> list[str]:
    """Return the dofs' names, without the prefix that all of them share."""
    names = [str(name) for name in rollout.meta["robot"]["dofs"]]
    first, last = min(names), max(names)
    shared = 0
    while shared < min(len(first), len(last)) and first[shared] == last[shared]:
        shared += 1
    cut = first[:shared].rfind("_") + 1
    short = [name[cut:] for name in names]
    return short if all(name[:1].isalpha() for name in short) else names


def joint_positions(rollout: Rollout, *, absolute: bool = True) -> tuple[Array, str]:
    """Return the joints' unwrapped positions (N, nv), and which angles they are."""
    positions = rollout["joint_positions"]
    if absolute and rollout.meta["robot"].get("joint_coordinates") == "absolute":
        return np.cumsum(positions, axis=1), "absolute joint angle"
    return positions, "joint position"


def decay_power(rollout: Rollout) -> Array | None:
    """Return e_NᵀW K_N e_N at every row, shape (N,); None if K_N or W is not known."""
    gain = rollout.meta.get("null_space_gain")
    if gain is None or not rollout.meta.get("controls_null_space", True):
        return None
    K_N, e = np.asarray(gain, dtype=float), rollout["null_space_error"]
    if np.array_equal(K_N, K_N[0, 0] * np.eye(len(K_N))):
        return np.asarray(K_N[0, 0] * rollout["null_space_norm"] ** 2)
    W = constant_metric(rollout)
    return None if W is None else np.einsum("ni,ij,nj->n", e, W @ K_N, e)


def constant_metric(rollout: Rollout) -> Array | None:
    """Return the metric W, shape (nv, nv); None if it is not constant."""
    if rollout.meta.get("metric") == "IdentityMetric":
        return np.eye(int(rollout.meta["robot"]["nv"]))
    matrix = rollout.meta.get("metric_matrix")
    return None if matrix is None else np.array(matrix)


def limit(rollout: Rollout, name: str) -> Array:
    """Return a limit of `RobotLimits` at the end of a run, shape (nv,), or inf."""
    known = rollout.meta.get("limits", {}).get(name) or [None] * rollout.v.shape[1]
    return np.array([np.inf if each is None else each for each in known])


MAX_NAMED, SELECTED = 14, 7
"""Of more than 14 curves, only the 7 that vary most get a colour and a name."""


def lively(values: Array) -> list[int]:
    """Return the columns that get a name, of shape (N, k)."""
    if values.shape[1] <= MAX_NAMED:
        return [*range(values.shape[1])]
    known = np.isfinite(values)  # a gap is no variation
    high = np.where(known, values, -np.inf).max(axis=0)
    low = np.where(known, values, np.inf).min(axis=0)
    spread = np.where(known.any(axis=0), high - low, 0.0)
    return sorted(np.argsort(-spread, kind="stable")[:SELECTED].tolist())


def spans_of(
    times: Array, active: NDArray[np.bool_], closed: float = 0.0
) -> list[tuple[float, float]]:
    """Return the intervals in which rows are active; each row lasts until the next."""
    edges = np.diff(np.concatenate([[False], active, [False]]).astype(np.int8))
    starts = times[np.flatnonzero(edges > 0)].tolist()
    stops = times[np.flatnonzero(edges < 0).clip(max=len(times) - 1)].tolist()
    spans: list[tuple[float, float]] = []
    for start, stop in zip(starts, stops, strict=True):
        if spans and start - spans[-1][1] <= closed:
            spans[-1] = spans[-1][0], stop
        else:
            spans.append((start, stop))
    return spans


def field_terms(rollout: Rollout) -> list[str]:
    """Return the names of the field's terms whose share of g is in the log."""
    inside = re.compile(r"field\.(.+)\.g")
    found = (inside.fullmatch(name) for name in rollout.columns)
    return [match[1] for match in found if match]


def held_period(rollout: Rollout) -> float | None:
    """Return the time for which each effort of a run was held [s]; None if unknown."""
    settings = (rollout.config or {}).get("simulation")
    period = settings.get("control_period") if isinstance(settings, dict) else None
    if isinstance(period, int | float) and 0.0 < period < float("inf"):
        return float(period)
    return None


def chosen_rows(
    rollout: Rollout, count: int = 8, times: Sequence[float] | None = None
) -> list[int]:
    """Return the rows of movie frames, in order and without repetition."""
    t = rollout.t
    if times is None:
        rows = np.linspace(0, len(t) - 1, min(count, len(t))).round().astype(int)
    else:
        rows = np.array([np.argmin(np.abs(t - time)) for time in times], dtype=int)
    return [int(row) for row in np.unique(rows)]


class LoggedDistance(NamedTuple):
    """A minimum distance over time."""

    label: str  # the measured distance
    values: Array  # the distance [m], shape (N,)
    edge: float | None  # the distance at contact [m]; None if it is not one number
    edge_name: str = ""  # name of the edge; "" for zero


def logged_distances(rollout: Rollout) -> list[LoggedDistance]:
    """Return the minimum distances in a log."""
    names = distances(rollout)
    labels = [distance_label(rollout.meta, name) for name in names]
    found = []
    for name, label in zip(names, labels, strict=True):
        unique = label if labels.count(label) == 1 else f"{label} ({name})"
        edge, edge_name = _edge(rollout.meta, name)
        values = rollout[f"distance.{name}"]
        found.append(LoggedDistance(unique, values, edge, edge_name))
    return found


def distance_label(meta: Mapping[str, Any], name: str) -> str:
    """Return the description of a distance."""
    center = _center_of(meta, name)
    return f"joint to centre of {center}" if center else name.replace("_", " ")


def _center_of(meta: Mapping[str, Any], name: str) -> str:
    """Return the obstacle to whose centre a distance is measured; "" if to surfaces."""
    about = meta.get("columns", {}).get(f"distance.{name}", {})
    return str(about.get("center_of", ""))


def _edge(meta: Mapping[str, Any], name: str) -> tuple[float | None, str]:
    center = _center_of(meta, name)
    if not center:
        kept = meta.get("columns", {}).get(f"distance.{name}", {}).get("minimum", 0.0)
        return float(kept), f"limit {kept:g} m" if kept else ""
    about = meta.get("obstacles", {}).get(center, {})
    # Only a ball has its surface at one distance from its centre.
    if about.get("shape") != "Sphere" or about.get("radius") is None:
        return None, ""
    radius = float(about["radius"])
    return radius, f"radius {radius:g} m"


ROUNDING = 1e-12
"""Ratio of ‖e_N(0)‖ to the speeds from which it is computed, below which it is
rounding."""


class Decay(NamedTuple):
    """The prediction of ‖e_N‖_W, or the reason why there is none."""

    slow: Array | None  # upper bound, shape (N,); None without a prediction
    fast: Array | None  # lower bound, shape (N,); the same array for a scalar gain
    gains: tuple[float, float]  # the rates of the upper and the lower bound [1/s]
    why_not: str  # why there is no prediction; "" if there is one


def predicted_decay(rollout: Rollout) -> Decay:
    """Return ‖e_N(0)‖_W exp(-K_N t), or bounds for a matrix K_N.

    ``docs/law.md``, Equations (7) and (13) over a metric, Proposition 2.
    V' = -e_NᵀW K_N e_N lies between -2V times the largest and -2V times the smallest
    eigenvalue of the symmetric part of W K_N relative to W.
    """
    if not rollout.meta.get("controls_null_space", True):
        why = "no prediction: self-motion is not controlled"
        return Decay(None, None, (0.0, 0.0), why)
    gain = rollout.meta.get("null_space_gain")
    if gain is None:
        why = "no prediction: $K_N$ not in the log"
        return Decay(None, None, (0.0, 0.0), why)
    K_N = np.asarray(gain, dtype=float)
    multiple = K_N[0, 0] * np.eye(len(K_N))
    scalar = np.array_equal(K_N, multiple)
    W = np.eye(len(K_N)) if scalar else constant_metric(rollout)
    if W is None:
        why = "no prediction: $K_N$ is a matrix, $W$ not in the log"
        return Decay(None, None, (0.0, 0.0), why)
    power = 0.5 * (W @ K_N + (W @ K_N).T)
    from scipy.linalg import eigh  # here: importing SciPy is slow

    rates = eigh(power, W, eigvals_only=True)
    slowest, fastest = float(rates[0]), float(rates[-1])
    norm, elapsed = rollout["null_space_norm"], rollout.t - rollout.t[0]
    speeds = np.linalg.norm(rollout["field.g"], axis=1)
    speeds = speeds + np.linalg.norm(rollout.v, axis=1)
    # They are unknown without the law, as in a safe stop.
    if not norm[0] > ROUNDING * float(np.nanmax(speeds, initial=0.0)):
        why = "no prediction: starts with $e_N$ = 0"
        return Decay(None, None, (slowest, fastest), why)
    slow = norm[0] * np.exp(-slowest * elapsed)
    fast = slow if scalar else norm[0] * np.exp(-fastest * elapsed)
    return Decay(slow, fast, (slowest, fastest), "")
