"""Check that wrong arguments and functions of fields are refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from field_cases import evaluate, placed
from field_oracles import OBSTACLE, ValueOnly, load

from hsp_control import (
    FunctionCost,
    HspControlError,
    JointCentering,
    NullSpaceField,
    Obstacle,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
)
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    FieldError,
    FrameNotFoundError,
    JointNotFoundError,
    SceneError,
    ShapeError,
)
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import (
    EqualJointAngles,
    FieldSample,
    FieldSum,
    FunctionField,
    LimitBarrier,
    ObstacleClearance,
    PointDistance,
    Ramp,
    Uncontrolled,
)
from hsp_control.null_space.metrics import IdentityMetric, Metric
from hsp_control.trajectories import Hold


def arm() -> Robot:
    return load("planar3r")


def at_rest(name: str) -> RobotState:
    robot = load(name)
    return robot.state(0.0, robot.neutral(), np.zeros(robot.nv))


def on(name: str, field: NullSpaceField) -> NullSpaceField:
    """Place a field on a robot without obstacles."""
    return placed(field, at_rest(name))


def used(field: NullSpaceField, metric: Metric | None = None) -> FieldSample:
    robot = arm()
    state = robot.state(0.25, robot.neutral(), np.ones(robot.nv))
    return evaluate(field, metric or IdentityMetric(), state)


def cost(value: Any = 0.0, *, name: str = "", **options: Any) -> FunctionCost:
    """Return a cost of the planar arm whose functions return constants."""
    functions = {
        f"{key}_function": lambda s, given=given: given
        for key, given in options.items()
    }
    return FunctionCost(lambda s: value, name=name, **functions)


class Wrong(ValueOnly):
    """A cost whose value or gradient is what it is told."""

    given: Any
    slope: Any = None

    def value(self, state: RobotState) -> float:
        return self.given

    def gradient(self, state: RobotState) -> Array:
        return super().gradient(state) if self.slope is None else self.slope


def at_the_centre() -> PointDistance:
    tip = arm().state(0.0, arm().neutral(), np.zeros(3)).position("tip").copy()
    ball = Obstacle("ball", Sphere(0.1), Hold(tip))
    return PointDistance(["link2", "tip"], ball, name="away")


CENTRE = (
    r"^field 'away': frame 'tip' is at the centre of obstacle 'ball', where the cost "
    r"is infinite$"
)
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    # construction
    "centering, negative weight": (lambda: JointCentering(weights=-1.0), FieldError,
     r"^JointCentering: weights: -1.0 is negative; must be at least 0$"),
    "centering, infinite weight": (
     lambda: JointCentering(weights=[1, 2, 3, np.inf, 5, 6, 7]), FieldError,
     r"^JointCentering: weights.3: inf is not a finite number$"),
    "posture, word": (lambda: TargetPosture("hom"),  # type: ignore
     FieldError, r"^TargetPosture: target: 'hom' is a str; expected 'start', 'home' or "
     r"a list of numbers; did you mean 'home'\?"),
    "equal angles, one joint": (lambda: EqualJointAngles(["joint1"]), FieldError,
     r"^EqualJointAngles: joints: \['joint1'\] has 1 entry, needs at least 2$"),
    "distance, no frame": (lambda: PointDistance([], OBSTACLE), FieldError,
     r"^PointDistance: frames: \[\] has 0 entries, needs at least 1$"),
    "clearance, obstacle": (lambda: ObstacleClearance([0.3]),  # type: ignore
     FieldError,
     r"^ObstacleClearance: obstacles.0: 0.3 is a float; expected a str"),
    "sum, empty": (lambda: FieldSum([]), FieldError,
     r"^FieldSum: a sum of fields needs at least one term$"),
    "sum, uncontrolled": (lambda: Uncontrolled() + Rest(), FieldError,
     r"^FieldSum: an uncontrolled null space cannot be part of a sum$"),
    "uncontrolled, ramp": (lambda: Uncontrolled(weight=Ramp(final=1.0, duration=1.0)),
     FieldError, r"^Uncontrolled: an uncontrolled null space has no weight$"),
    # placing
    "centering, no limits": (lambda: on("planar3r", JointCentering()), FieldError,
     r"^no joint of planar3r has limits; use a target posture instead$"),
    "centering, number of weights": (
     lambda: on("panda", JointCentering(weights=[1.0, 2.0])), FieldError,
     r"^weights: weights have shape \(2,\); needs one number or 7$"),
    "posture, shape": (lambda: on("planar3r", TargetPosture([0.0, 0.0])), ShapeError,
     r"^target: a posture has shape \(2,\); needs 3 or 6 numbers$"),
    "posture, no weight": (lambda: on("planar3r", TargetPosture("home", weights=0.0)),
     FieldError, r"^weights: every weight is 0$"),
    "equal angles, joint": (
     lambda: on("planar3r", EqualJointAngles(["joint1", "joint4"])),
     JointNotFoundError, r"^joints.1: no joint 'joint4'; did you mean 'joint\d'\?"),
    "equal angles, root": (
     lambda: on("rolling ur5", EqualJointAngles(["root_joint", "elbow_joint"])),
     FieldError, r"^joints.0: joint 'root_joint' has 3 degrees of freedom; needs 1$"),
    "distance, frame": (
     lambda: on("planar3r", PointDistance(["link2", "tipp"], OBSTACLE)),
     FrameNotFoundError, r"^frames.1: no frame 'tipp'; did you mean 'tip'\?"),
    "distance, obstacle": (
     lambda: placed(PointDistance(["link2"], "bal"), at_rest("planar3r"), [OBSTACLE]),
     SceneError,
     r"^obstacle: no obstacle 'bal'; did you mean 'ball'\? \(the scene has ball\)$"),
    "barrier, no limits": (lambda: on("planar3r", LimitBarrier()), FieldError,
     r"^no joint of planar3r has limits; use a target posture instead$"),
    "barrier, number of weights": (
     lambda: on("panda", LimitBarrier(weights=[1.0, 2.0])), FieldError,
     r"^weights: weights have shape \(2,\); needs one number or 7$"),
    "in a sum, placed": (lambda: on("planar3r", Rest() + LimitBarrier()), FieldError,
     r"^1: no joint of planar3r has limits; use a target posture instead$"),
    "posture, not placed": (lambda: used(TargetPosture("home")), FieldError,
     r"^field 'target_posture': a controller would look up its posture; outside of "
     r"one, call `placed` first$"),
    "distance, not placed": (lambda: used(PointDistance(["tip"], "ball")), FieldError,
     r"^field 'point_distance': a controller would look up its obstacle;"),
    "clearance, one not placed": (
     lambda: used(ObstacleClearance([OBSTACLE, "box"], name="mine")), FieldError,
     r"^field 'mine': a controller would look up its obstacles;"),
    # evaluation
    "value, nan": (lambda: used(cost(np.nan, name="mine")), FieldError,
     r"^cost 'mine' returned nan at t = 0.25 s; needs one finite number$"),
    "value, array": (lambda: used(cost(np.zeros(3))), FieldError,
     r"returned array\(\[0., 0., 0.\]\) at t = 0.25 s; needs one finite number"),
    "gradient, shape of q": (lambda: used(cost(gradient=np.zeros(6))), FieldError,
     r"^cost 'function_cost' has a gradient of shape \(6,\); needs \(3,\): the "
     r"tangent space, not the configuration$"),
    "gradient, words": (lambda: used(cost(gradient="steep")), FieldError,
     r"^cost 'function_cost' has the gradient 'steep'; needs numbers$"),
    "gradient, nan": (lambda: used(cost(gradient=[0.0, np.nan, 0.0])), FieldError,
     r"^cost 'function_cost' has the gradient .*nan.* at t = 0.25 s; needs finite"),
    "gradient rate, shape": (
     lambda: used(cost(gradient=np.zeros(3), rate=np.zeros((3, 1)))), FieldError,
     r"^cost 'function_cost' has a gradient rate of shape \(3, 1\); needs \(3,\)"),
    "gradient rate, infinite": (
     lambda: used(cost(gradient=np.zeros(3), rate=[0.0, np.inf, 0.0])), FieldError,
     r"the gradient rate .*inf.*; needs finite numbers$"),
    "own cost, gradient": (lambda: used(Wrong("tip", 0.0, np.zeros(2), name="mine")),
     FieldError, r"^cost 'mine' has a gradient of shape \(2,\); needs \(3,\)"),
    "vector, shape": (lambda: used(FunctionField(lambda s: np.zeros(6))), FieldError,
     r"^field 'function_field' returned g = array\(\[0., .*\]\) at t = 0.25 s; needs "
     r"3 finite numbers$"),
    "vector, number": (lambda: used(FunctionField(lambda s: 1.0)),  # type: ignore
     FieldError, r"returned g = 1.0 at t"),
    "rate, shape": (lambda: used(
        FunctionField(lambda s: np.zeros(3), rate_function=lambda s: np.zeros(1))),
     FieldError,
     r"^field 'function_field' returned g' = array\(\[0.\]\) at t = 0.25 s; needs 3"),
    "rate, infinite": (lambda: used(
     FunctionField(lambda s: np.zeros(3), rate_function=lambda s: np.full(3, np.inf))),
     FieldError, r"returned g' = array\(\[inf, inf, inf\]\)"),
    "in a sum": (lambda: used(Rest() + cost(np.nan, name="mine")), FieldError,
     r"^cost 'mine' returned nan"),
    "distance, at the centre": (lambda: used(at_the_centre()), FieldError, CENTRE),
    "distance, at the centre, value": (
     lambda: at_the_centre().value(arm().state(0, arm().neutral(), np.zeros(3))),
     FieldError, CENTRE),
}  # fmt: skip


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=message) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind
