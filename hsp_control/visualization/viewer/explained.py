"""What a controller can tell about a state besides the effort."""

from collections.abc import Iterator
from typing import TypeVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.null_space.fields import NullSpaceField, WeightedSum
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import RobotState

_Term = TypeVar("_Term", bound=NullSpaceField)


def terms(field: NullSpaceField, kind: type[_Term]) -> Iterator[_Term]:
    """Yield the terms of a field that are of a kind."""
    each = [field]
    if isinstance(field, WeightedSum):
        each = [term for _, term in field.terms]
    yield from (term for term in each if isinstance(term, kind))


def null_space_projector(controller: Controller, state: RobotState) -> Array:
    """Return P = I - J#J in the controller's metric, shape (nv, nv).

    J has the rows of all that counts at the state's time, contacts and tasks, and
    J# = W⁻¹Jᵀ(J W⁻¹Jᵀ)⁻¹; where they lose rank, P is that of the rank left.
    """
    J = controller.stack(state).jacobian
    nv = controller.robot.nv
    metric = controller.metric.evaluate(state, MetricSample.allocate(nv))
    # With W = L Lᵀ, P = L⁻ᵀ (I - B⁺B) Lᵀ for B = J L⁻ᵀ.
    B = np.linalg.solve(metric.L, J.T).T
    within = np.eye(nv) - np.linalg.pinv(B, rcond=1e-9) @ B
    return np.asarray(np.linalg.solve(metric.L.T, within @ metric.L.T))
