"""Every null-space field on several robots, with its oracle."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pytest
from field_oracles import (
    JOINTS,
    ROBOTS,
    TIME,
    Plain,
    Swirl,
    SwirlWithRate,
    ValueOnly,
    WithGradient,
    barrier_oracle,
    centering_oracle,
    coupling,
    distance_oracle,
    equal_oracle,
    frames_of,
    load,
    plain,
    point_distance,
    position_axes,
    posture_oracle,
    ramp,
    reach_cost,
    reach_oracle,
    root_of_determinant,
    rows_of,
    spectrum_oracle,
    spread,
    state_weight,
    swaying,
    swirl_field,
    swirl_oracle,
    target,
)

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.geometry import Scene
from hsp_control.geometry.scene import Start

Field = TypeVar("Field", bound=hsp.NullSpaceField)


def placed(
    field: Field, state: hsp.RobotState, scene: Iterable[hsp.Obstacle] = ()
) -> Field:
    """Return a field, placed at the robot's start."""
    return field.placed(Start(state, Scene(scene)))


@dataclass(frozen=True)
class Member:
    """A field, and the same by plain Pinocchio.

    Attributes:
        make: The field for a robot, not yet placed.
        parts: (weight, oracle, whether a cost) of each term; a vector field's is g,
            and a weight may be a function of (t, q).
        rate_accuracy: Largest error of g', relative to its scale: rounding where it is
            known in closed form, 2e-11 by differences, and by differences of a
            differenced gradient 1e-9, the promise of `Cost`.
    """

    make: Callable[[str], hsp.NullSpaceField]
    parts: Callable[[str], list[tuple[Any, Any, bool]]]
    rate_accuracy: float = 5e-12
    robots: tuple[str, ...] = tuple(ROBOTS)

    def build(self, name: str) -> hsp.NullSpaceField:
        """Return the field, placed on a robot at rest at home."""
        robot = load(name)
        return placed(
            self.make(name), robot.state(0.0, robot.home(), np.zeros(robot.nv))
        )


def posture(name: str, **options: Any) -> hsp.TargetPosture:
    return hsp.TargetPosture(target(name), **options)


def weighted(name: str) -> hsp.NullSpaceField:
    frame = frames_of(name)[2]
    of_state = hsp.fields.StateWeight(
        lambda s: 1.5 + np.sin(s.t + s.position(frame)[0])
    )
    return hsp.fields.Ramp(initial=0.5, final=2.0, start=0.3, duration=1.0) * (
        3.0 * posture(name) + point_distance(name)
    ) + of_state * swirl_field(name, rate=True)


LIMITED = ("panda", "kinova", "floating ur5", "rolling ur5")


def of_cost(
    make: Callable[[str], hsp.NullSpaceField],
    oracle: Callable[[str], Any],
    robots: tuple[str, ...] = tuple(ROBOTS),
    accuracy: float = 5e-12,
    *,
    cost: bool = True,
) -> Member:
    """Return a field of one term with the weight 1; a cost, or g itself."""
    return Member(make, lambda n: [(1.0, oracle(n), cost)], accuracy, robots)


def of_spectrum(
    make: Callable[..., hsp.NullSpaceField],
    function: Callable[[str, Array], float],
    **options: Any,
) -> Member:
    """Return a field of a function of J W⁻¹ Jᵀ of the last frame's position."""

    def field(n: str) -> hsp.NullSpaceField:
        own = {k: each(n) if callable(each) else each for k, each in options.items()}
        return make(frames_of(n)[2], axes=position_axes(n), **own)

    def oracle(n: str) -> Any:
        metric = options["metric"](n) if "metric" in options else None
        return spectrum_oracle(n, lambda G: function(n, G), metric=metric)

    return of_cost(field, oracle)


def weights_of(n: str) -> Array:
    return spread(load(n).nv, 0.0, 3.0)


MEMBERS: dict[str, Member] = {
    "rest": Member(lambda n: hsp.Rest(), lambda n: []),
    "uncontrolled": Member(lambda n: hsp.fields.Uncontrolled(), lambda n: []),
    "joint_centering": of_cost(
        lambda n: hsp.JointCentering(), centering_oracle, LIMITED
    ),
    "joint_centering, weights": of_cost(
        lambda n: hsp.JointCentering(weights=weights_of(n)),
        lambda n: centering_oracle(n, weights_of(n)),
        LIMITED,
    ),
    "target_posture": of_cost(posture, posture_oracle),
    "target_posture, weights": of_cost(
        lambda n: posture(n, weights=weights_of(n)),
        lambda n: posture_oracle(n, weights_of(n)),
    ),
    "target_posture, moving": of_cost(
        lambda n: posture(n, displacement=swaying(n)),
        lambda n: posture_oracle(n, sways=True),
    ),
    "equal_joint_angles": of_cost(
        lambda n: hsp.fields.FieldSum(
            [hsp.fields.EqualJointAngles(JOINTS[ROBOTS[n][0]], weight=5.0)]
        ),
        lambda n: equal_oracle(n, 5.0),
    ),
    "point_distance": of_cost(
        lambda n: hsp.fields.FieldSum([point_distance(n)]),
        lambda n: distance_oracle(n, 0.4),
    ),
    "limit_barrier": of_cost(
        lambda n: hsp.fields.LimitBarrier(zone=0.9, weights=weights_of(n)),
        lambda n: barrier_oracle(n, 0.9, weights_of(n)),
        LIMITED,
    ),
    "manipulability": of_spectrum(
        hsp.Manipulability, lambda n, G: root_of_determinant(G)
    ),
    "manipulability, determinant, metric": of_spectrum(
        hsp.Manipulability,
        lambda n, G: -np.linalg.det(G),
        form="determinant",
        metric=coupling,
    ),
    "manipulability, log, pose": of_cost(
        lambda n: hsp.Manipulability(
            frames_of(n)[2], form="log", rows="pose", length=0.5
        ),
        lambda n: spectrum_oracle(
            n, lambda G: -0.5 * np.linalg.slogdet(G)[1], list(range(6)), 0.5
        ),
        LIMITED,
    ),
    "manipulability, orientation": of_cost(
        lambda n: hsp.Manipulability(frames_of(n)[2], rows="orientation"),
        lambda n: spectrum_oracle(n, root_of_determinant, [3, 4, 5]),
        LIMITED,
    ),
    "inverse_condition": of_spectrum(
        hsp.fields.InverseCondition,
        lambda n, G: -(len(G) ** 2) / np.trace(G) / np.trace(np.linalg.inv(G)),
    ),
    "function_cost": of_cost(reach_cost, reach_oracle, accuracy=1e-9),
    "function_cost, gradient": of_cost(
        lambda n: reach_cost(n, gradient=True), reach_oracle, accuracy=2e-11
    ),
    "function_cost, gradient and rate": of_cost(
        lambda n: reach_cost(n, gradient=True, rate=True), reach_oracle
    ),
    "own cost, value only": of_cost(
        lambda n: ValueOnly(frames_of(n)[2]), reach_oracle, accuracy=1e-9
    ),
    "own cost, gradient": of_cost(
        lambda n: WithGradient(frames_of(n)[2]), reach_oracle, accuracy=2e-11
    ),
    "function_field": of_cost(
        lambda n: swirl_field(n, rate=False), swirl_oracle, accuracy=2e-11, cost=False
    ),
    "function_field, rate": of_cost(
        lambda n: swirl_field(n, rate=True), swirl_oracle, cost=False
    ),
    "own vector field": of_cost(
        lambda n: Swirl(frames_of(n)[2]), swirl_oracle, accuracy=2e-11, cost=False
    ),
    "own vector field, rate": of_cost(
        lambda n: SwirlWithRate(frames_of(n)[2]), swirl_oracle, cost=False
    ),
    "sum of a sum and a vector field": Member(
        lambda n: (
            0.5 * (3.0 * posture(n) + 2 * point_distance(n))
            + 0.7 * swirl_field(n, rate=False)
            + hsp.Rest()
        ),
        lambda n: [
            (1.5, posture_oracle(n), True),
            (1.0, distance_oracle(n, 0.4), True),
            (0.7, swirl_oracle(n), False),
        ],
        rate_accuracy=2e-11,
    ),
    "sum, weights of time and of the state": Member(
        weighted,
        lambda n: [
            (lambda t, q: 3.0 * ramp(t, q), posture_oracle(n), True),
            (ramp, distance_oracle(n, 0.4), True),
            (state_weight(n), swirl_oracle(n), False),
        ],
        rate_accuracy=2e-11,
    ),
}
FIELD_CASES = [(name, which) for which, m in MEMBERS.items() for name in m.robots]
every_field = pytest.mark.parametrize(("name", "which"), FIELD_CASES)


def metrics(
    robot: hsp.Robot,
) -> dict[str, tuple[hsp.metrics.Metric, Callable[[Array], Array]]]:
    """Return the three metrics, each with W(q) by plain Pinocchio."""
    rng = np.random.default_rng(5)
    A = np.eye(robot.nv) + 0.3 * rng.normal(size=(robot.nv, robot.nv))
    return {
        "identity": (hsp.metrics.IdentityMetric(), lambda q: np.eye(robot.nv)),
        "constant": (hsp.metrics.ConstantMetric(A.T @ A), lambda q: A.T @ A),
        "mass matrix": (hsp.metrics.MassMatrixMetric(), Plain(robot).mass_matrix),
    }


def evaluate(
    field: hsp.NullSpaceField, metric: hsp.metrics.Metric, state: hsp.RobotState
) -> hsp.fields.FieldSample:
    """Return copies of g and g' at a state."""
    nv = state.robot.nv
    sample = metric.evaluate(state, hsp.metrics.MetricSample.allocate(nv))
    out = hsp.fields.FieldSample(np.full(nv, np.nan), np.full(nv, np.nan))
    assert field.evaluate(state, sample, metric.form, out) is out
    return out


def draw(name: str, seed: int) -> tuple[Array, Array]:
    """Return a state off the kink of equal joint angles, obstacle and singularities."""
    robot, rng = load(name), np.random.default_rng(seed)
    indices = [robot.velocity_index(j).start for j in JOINTS[ROBOTS[name][0]]]
    for _ in range(200):
        q = robot.random_configuration(rng)
        d = np.diff(plain(name).angles(q)[indices])
        clear = np.abs(np.arctan2(np.sin(d), np.cos(d))).max() < 2.5
        J = rows_of(name, q, frames_of(name)[2], list(range(6)))
        kept = J[: len(position_axes(name))] if name == "planar3r" else J
        clear = clear and np.linalg.svd(kept)[1][-1] > 0.1
        if clear and distance_oracle(name, 1.0)(TIME, q) < 20.0:
            return q, 0.7 * rng.normal(size=robot.nv)
    raise AssertionError("no such configuration")
