"""The minimum distances in a log: what each measures, and what it must not fall below.

A clearance measures between surfaces, which touch at zero. The paper's cost measures
from joints to an obstacle's centre: a joint is inside a ball below the ball's radius.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import distances


class LoggedDistance(NamedTuple):
    """A minimum distance over time."""

    label: str  # what it measures
    values: Array  # the distance [m], shape (N,)
    edge: float | None  # the distance at contact [m]; None if it is not one number
    edge_name: str = ""  # what the edge is; "" for zero, which needs no name


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
    """Return what a distance measures."""
    center = _center_of(meta, name)
    return f"joint to centre of {center}" if center else name.replace("_", " ")


def _center_of(meta: Mapping[str, Any], name: str) -> str:
    """Return the obstacle to whose centre a distance leads; "" if to surfaces."""
    about = meta.get("columns", {}).get(f"distance.{name}", {})
    return str(about.get("center_of", ""))


def _edge(meta: Mapping[str, Any], name: str) -> tuple[float | None, str]:
    center = _center_of(meta, name)
    if not center:
        return 0.0, ""
    about = meta.get("obstacles", {}).get(center, {})
    # Only a ball has its surface at one distance from its centre.
    if about.get("shape") != "Sphere" or about.get("radius") is None:
        return None, ""
    radius = float(about["radius"])
    return radius, f"radius {radius:g} m"
