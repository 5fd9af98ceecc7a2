"""Every null-space field on several robots, each beside its oracle."""

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
    direction,
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
from numpy.typing import NDArray

import hsp_control as hsp
from hsp_control.geometry import Scene
from hsp_control.geometry.start import Start

Array = NDArray[np.float64]


Field = TypeVar("Field", bound=hsp.NullSpaceField)


def placed(
    field: Field, state: hsp.RobotState, scene: Iterable[hsp.Obstacle] = ()
) -> Field:
    """Return a field, placed where the robot starts."""
    return field.placed(Start(state, Scene(scene)))


@dataclass(frozen=True)
class Member:
    """A field, and the same once more with plain Pinocchio.

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
MEMBERS: dict[str, Member] = {
    "rest": Member(lambda n: hsp.Rest(), lambda n: []),
    "uncontrolled": Member(lambda n: hsp.fields.Uncontrolled(), lambda n: []),
    "joint_centering": Member(
        lambda n: hsp.JointCentering(),
        lambda n: [(1.0, centering_oracle(n), True)],
        robots=LIMITED,
    ),
    "joint_centering, weights": Member(
        lambda n: hsp.JointCentering(weights=spread(load(n).nv, 0.0, 3.0)),
        lambda n: [(1.0, centering_oracle(n, spread(load(n).nv, 0.0, 3.0)), True)],
        robots=LIMITED,
    ),
    "target_posture": Member(
        lambda n: posture(n), lambda n: [(1.0, posture_oracle(n), True)]
    ),
    "target_posture, weights": Member(
        lambda n: posture(n, weights=spread(load(n).nv, 0, 3)),
        lambda n: [(1.0, posture_oracle(n, spread(load(n).nv, 0, 3)), True)],
    ),
    "target_posture, moving": Member(
        lambda n: posture(n, displacement=swaying(n)),
        lambda n: [(1.0, posture_oracle(n, sways=True), True)],
    ),
    "equal_joint_angles": Member(
        lambda n: hsp.fields.FieldSum(
            [hsp.fields.EqualJointAngles(JOINTS[ROBOTS[n][0]], weight=5.0)]
        ),
        lambda n: [(1.0, equal_oracle(n, 5.0), True)],
    ),
    "point_distance": Member(
        lambda n: hsp.fields.FieldSum([point_distance(n)]),
        lambda n: [(1.0, distance_oracle(n, 0.4), True)],
    ),
    "limit_barrier": Member(
        lambda n: hsp.fields.LimitBarrier(zone=0.9),
        lambda n: [(1.0, barrier_oracle(n, 0.9), True)],
        robots=LIMITED,
    ),
    "manipulability": Member(
        lambda n: hsp.Manipulability(frames_of(n)[2], axes=position_axes(n)),
        lambda n: [(1.0, spectrum_oracle(n, root_of_determinant), True)],
    ),
    "manipulability, determinant, metric": Member(
        lambda n: hsp.Manipulability(
            frames_of(n)[2],
            axes=position_axes(n),
            form="determinant",
            metric=coupling(n),
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(n, lambda G: -np.linalg.det(G), metric=coupling(n)),
                True,
            )
        ],
    ),
    "manipulability, log, pose": Member(
        lambda n: hsp.Manipulability(
            frames_of(n)[2], form="log", rows="pose", length=0.5
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n, lambda G: -0.5 * np.linalg.slogdet(G)[1], list(range(6)), 0.5
                ),
                True,
            )
        ],
        robots=LIMITED,
    ),
    "manipulability, orientation": Member(
        lambda n: hsp.Manipulability(frames_of(n)[2], rows="orientation"),
        lambda n: [(1.0, spectrum_oracle(n, root_of_determinant, [3, 4, 5]), True)],
        robots=LIMITED,
    ),
    "inverse_condition": Member(
        lambda n: hsp.fields.InverseCondition(frames_of(n)[2], axes=position_axes(n)),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n,
                    lambda G: -(len(G) ** 2) / np.trace(G) / np.trace(np.linalg.inv(G)),
                ),
                True,
            )
        ],
    ),
    "transmission, velocity": Member(
        lambda n: hsp.fields.Transmission(
            frames_of(n)[2], direction=3.0 * direction(n), axes=position_axes(n)
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n,
                    lambda G: (
                        -((direction(n) @ np.linalg.inv(G) @ direction(n)) ** -0.5)
                    ),
                ),
                True,
            )
        ],
    ),
    "transmission, force": Member(
        lambda n: hsp.fields.Transmission(
            frames_of(n)[2], direction=direction(n), kind="force", axes=position_axes(n)
        ),
        lambda n: [
            (
                1.0,
                spectrum_oracle(
                    n, lambda G: -((direction(n) @ G @ direction(n)) ** -0.5)
                ),
                True,
            )
        ],
    ),
    "function_cost": Member(
        reach_cost, lambda n: [(1.0, reach_oracle(n), True)], rate_accuracy=1e-9
    ),
    "function_cost, gradient": Member(
        lambda n: reach_cost(n, gradient=True),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=2e-11,
    ),
    "function_cost, gradient and rate": Member(
        lambda n: reach_cost(n, gradient=True, rate=True),
        lambda n: [(1.0, reach_oracle(n), True)],
    ),
    "own cost, value only": Member(
        lambda n: ValueOnly(frames_of(n)[2]),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=1e-9,
    ),
    "own cost, gradient": Member(
        lambda n: WithGradient(frames_of(n)[2]),
        lambda n: [(1.0, reach_oracle(n), True)],
        rate_accuracy=2e-11,
    ),
    "function_field": Member(
        lambda n: swirl_field(n, rate=False),
        lambda n: [(1.0, swirl_oracle(n), False)],
        rate_accuracy=2e-11,
    ),
    "function_field, rate": Member(
        lambda n: swirl_field(n, rate=True), lambda n: [(1.0, swirl_oracle(n), False)]
    ),
    "own vector field": Member(
        lambda n: Swirl(frames_of(n)[2]),
        lambda n: [(1.0, swirl_oracle(n), False)],
        rate_accuracy=2e-11,
    ),
    "own vector field, rate": Member(
        lambda n: SwirlWithRate(frames_of(n)[2]),
        lambda n: [(1.0, swirl_oracle(n), False)],
    ),
    "sum": Member(
        lambda n: posture(n) + point_distance(n),
        lambda n: [
            (1.0, posture_oracle(n), True),
            (1.0, distance_oracle(n, 0.4), True),
        ],
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
every_field = pytest.mark.parametrize(
    ("name", "which"),
    [(name, which) for which, m in MEMBERS.items() for name in m.robots],
)


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
    """Return g and g' at a state, in memory of their own."""
    nv = state.robot.nv
    sample = metric.evaluate(state, hsp.law.MetricSample.allocate(nv))
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
