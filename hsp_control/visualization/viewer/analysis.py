"""Quantities of a controller that the view draws: field terms, projector, floor."""

from collections.abc import Iterator
from typing import TypeVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.law import MetricSample
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.robot import RobotState

_Term = TypeVar("_Term", bound=NullSpaceField)


def terms_of_type(field: NullSpaceField, kind: type[_Term]) -> Iterator[_Term]:
    """Yield the terms of a field that are instances of a class."""
    yield from (term for term in terms_of(field) if isinstance(term, kind))


def from_the_start(controller: Controller) -> Controller:
    """Return the controller as it is before a run; its changes are all ahead."""
    if not controller.changes and not any(t.remembers for t in controller.tasks):
        return controller
    return controller.preview()


def null_space_projector(controller: Controller, state: RobotState) -> Array:
    """Return P = I - J#J in the metric W, (nv, nv), J of all that is active."""
    own = controller.state.update(state.t, state.q, state.v)  # of the same robot object
    J = controller.stack(own).jacobian
    nv = controller.robot.nv
    metric = controller.metric.evaluate(own, MetricSample.allocate(nv))
    # With W = L Lᵀ, P = L⁻ᵀ (I - B⁺B) Lᵀ for B = J L⁻ᵀ.
    B = np.linalg.solve(metric.L, J.T).T
    projector = np.eye(nv) - np.linalg.pinv(B, rcond=1e-9) @ B
    return np.asarray(np.linalg.solve(metric.L.T, projector @ metric.L.T))
