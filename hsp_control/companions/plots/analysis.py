"""Quantities of a controller that are drawn: field terms, projector, floor."""

from collections.abc import Iterator
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import TypeAdapter

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.log_series import held_period
from hsp_control.config.logged_run import logged_controller
from hsp_control.control.interface import Change, Controller
from hsp_control.law import MetricSample
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.robot import RobotState
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import packaged_folders
from hsp_control.simulation import Rollout

_Term = TypeVar("_Term", bound=NullSpaceField)


def terms_of_type(field: NullSpaceField, kind: type[_Term]) -> Iterator[_Term]:
    """Yield the terms of a field that are instances of a class."""
    yield from (term for term in terms_of(field) if isinstance(term, kind))


def acts(term: NullSpaceField) -> bool:
    """Return whether a term of a field may act: not with a constant weight of 0."""
    return not (isinstance(term.weight, int | float) and term.weight == 0.0)


def from_the_start(controller: Controller, run: Rollout) -> Controller:
    """Return the controller before a run, with all changes still to come."""
    changes = changes_of(run)
    if not changes and not any(t.remembers for t in controller.tasks):
        return controller
    return controller.preview(changes)


def changes_of(run: Rollout) -> tuple[Change, ...]:
    """Return the changes of a run, which its controller has forgotten."""
    data = run.meta.get("changes") or ()
    return TypeAdapter(tuple[Change, ...]).validate_python(data)


def null_space_projector(controller: Controller, state: RobotState) -> Array:
    """Return P = I - J#J in the metric W, (nv, nv), with J of all active rows.

    The controller, which replays a log, moves to the state.
    """
    controller.compute(state.t, state.q, state.v)
    stack, nv = controller.active_stack, controller.robot.nv
    J, metric = stack.rows.jacobian, stack.law.problem.metric
    # With W = L Lᵀ, P = L⁻ᵀ (I - B⁺B) Lᵀ for B = J L⁻ᵀ.
    B = np.linalg.solve(metric.L, J.T).T
    projector = np.eye(nv) - np.linalg.pinv(B, rcond=1e-9) @ B
    return np.asarray(np.linalg.solve(metric.L.T, projector @ metric.L.T))


_floors: "WeakKeyDictionary[Rollout, Array | None]" = WeakKeyDictionary()


def floor_of(rollout: Rollout) -> Array | None:
    """Return `expected_floor` for a log alone, whose controller is rebuilt; cached.

    A log may be untrusted: only packaged files are read, and of the code that it lists
    only files on this computer are imported that are the same as in the run.
    """
    if rollout not in _floors:
        packaged = only_within(packaged_folders())
        controller = logged_controller(rollout, packaged, True)
        _floors[rollout] = expected_floor(rollout, controller)
    return _floors[rollout]


_COARSEST = 1.0
"""Maximum K_N times the time between two rows: beyond it the rows miss the decay."""


def expected_floor(rollout: Rollout, controller: Controller | None) -> Array | None:
    """Return the expected floor of ‖e_N‖_W, shape (N,), to first order in the period.

    The derivation is in ``docs/law.md``, *Sampled control*: an effort that is held for
    h lags the law's by h/2 on average, so that

        e_N' = -K_N e_N + h/2 P M⁻¹ τ'.

    Its solution from e_N = 0 is the floor. The efforts are assumed to change linearly
    between two rows. None where the equation is not known or does not hold: without a
    controller, a control period or a gain, with contacts or a floating base, if the law
    changes during the run, or if the rows are too far apart.
    """
    period, gain = held_period(rollout), rollout.meta.get("null_space_gain")
    if controller is None or period is None or gain is None or len(rollout) < 2:
        return None
    if not rollout.meta.get("controls_null_space", True):
        return None
    robot, K_N = controller.robot, np.asarray(gain, float)
    if controller.contacts or robot.unactuated or changes_of(rollout):
        return None
    if K_N.shape != (robot.nv, robot.nv) or rollout.tau.shape[1] != robot.nv:
        return None
    steps = np.diff(rollout.t)
    if not 0.0 < np.linalg.norm(K_N, 2) * steps.max() <= _COARSEST:
        return None
    if np.linalg.cond(K_N) > 1e9 or not np.isfinite(rollout.tau).all():
        return None
    return _solve(rollout, controller.preview(), K_N, period)


def _solve(
    rollout: Rollout, controller: Controller, K_N: Array, period: float
) -> Array:
    """Integrate the error equation along the rows; return ‖e_N‖_W, shape (N,)."""
    from scipy.linalg import expm  # here: importing SciPy is slow

    nv = controller.robot.nv
    state = RobotState(controller.robot)
    metric = MetricSample.allocate(nv)
    decays: dict[float, tuple[Array, Array]] = {}
    error, floor = np.zeros(nv), np.zeros(len(rollout))
    for row in range(len(rollout) - 1):
        step = round(float(rollout.t[row + 1] - rollout.t[row]), 9)
        if step not in decays:
            decay = expm(-K_N * step)
            rest = np.linalg.solve(K_N, np.eye(nv) - decay) / max(step, 1e-9)
            decays[step] = decay, np.asarray(rest)
        decay, rest = decays[step]
        state.update(float(rollout.t[row]), rollout.q[row], rollout.v[row])
        change = np.linalg.solve(
            state.mass_matrix, rollout.tau[row + 1] - rollout.tau[row]
        )
        projector = null_space_projector(controller, state)
        error = decay @ error + 0.5 * period * rest @ projector @ change
        error = projector @ error  # the null space rotates
        metric = controller.metric.evaluate(state, metric)
        floor[row + 1] = float(np.linalg.norm(metric.L.T @ error))
    return floor
