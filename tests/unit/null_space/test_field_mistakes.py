"""Wrong arguments and functions of fields are refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from field_cases import evaluate, placed
from field_oracles import OBSTACLE, ValueOnly, load
from wording import wording

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
from hsp_control.common.errors import (
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
    """A cost whose value or gradient is a given one."""

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


CENTRE = "field 'away': ... 'tip' is at the centre of ... 'ball'"
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    # construction
    "centering, negative weight": (lambda: JointCentering(weights=-1.0), FieldError,
     "JointCentering: weights: -1.0 ... at least 0"),
    "centering, infinite weight": (
     lambda: JointCentering(weights=[1, 2, 3, np.inf, 5, 6, 7]), FieldError,
     "JointCentering: weights.3: inf ... finite"),
    "posture, word": (lambda: TargetPosture("hom"),  # type: ignore
     FieldError, "TargetPosture: target: 'hom' ... 'home'"),
    "equal angles, one joint": (lambda: EqualJointAngles(["joint1"]), FieldError,
     "EqualJointAngles: joints: ['joint1'] ... 1 ... at least 2"),
    "distance, no frame": (lambda: PointDistance([], OBSTACLE), FieldError,
     "PointDistance: frames: [] ... 0 ... at least 1"),
    "clearance, obstacle": (lambda: ObstacleClearance([0.3]),  # type: ignore
     FieldError,
     "ObstacleClearance: obstacles.0: 0.3 ... a str"),
    "sum, empty": (lambda: FieldSum([]), FieldError, "FieldSum: ... at least one"),
    "sum, uncontrolled": (lambda: Uncontrolled() + Rest(), FieldError,
     "FieldSum: ... uncontrolled ... sum"),
    "uncontrolled, ramp": (lambda: Uncontrolled(weight=Ramp(final=1.0, duration=1.0)),
     FieldError, "Uncontrolled: ... no weight"),
    # placing
    "centering, no limits": (lambda: on("planar3r", JointCentering()), FieldError,
     "no joint of planar3r has limits"),
    "centering, number of weights": (
     lambda: on("panda", JointCentering(weights=[1.0, 2.0])), FieldError,
     "weights: weights ... (2,) ... one number"),
    "posture, shape": (lambda: on("planar3r", TargetPosture([0.0, 0.0])), ShapeError,
     "target: ... (2,) ... 3 or 6"),
    "posture, no weight": (lambda: on("planar3r", TargetPosture("home", weights=0.0)),
     FieldError, "weights: every weight is 0"),
    "equal angles, joint": (
     lambda: on("planar3r", EqualJointAngles(["joint1", "joint4"])),
     JointNotFoundError, "joints.1: no ... 'joint4' ... 'joint"),
    "equal angles, root": (
     lambda: on("rolling ur5", EqualJointAngles(["root_joint", "elbow_joint"])),
     FieldError, "joints.0: ... 'root_joint' ... 3 ... 1"),
    "distance, frame": (
     lambda: on("planar3r", PointDistance(["link2", "tipp"], OBSTACLE)),
     FrameNotFoundError, "frames.1: no ... 'tipp' ... 'tip'"),
    "distance, obstacle": (
     lambda: placed(PointDistance(["link2"], "bal"), at_rest("planar3r"), [OBSTACLE]),
     SceneError,
     "obstacle: no ... 'bal' ... 'ball'"),
    "barrier, no limits": (lambda: on("planar3r", LimitBarrier()), FieldError,
     "no joint of planar3r has limits"),
    "barrier, number of weights": (
     lambda: on("panda", LimitBarrier(weights=[1.0, 2.0])), FieldError,
     "weights: weights ... (2,) ... one number"),
    "in a sum, placed": (lambda: on("planar3r", Rest() + LimitBarrier()), FieldError,
     "1: no joint of planar3r has limits"),
    "posture, not placed": (lambda: used(TargetPosture("home")), FieldError,
     "field 'target_posture': ... posture"),
    "distance, not placed": (lambda: used(PointDistance(["tip"], "ball")), FieldError,
     "field 'point_distance': ... obstacle"),
    "clearance, one not placed": (
     lambda: used(ObstacleClearance([OBSTACLE, "box"], name="mine")), FieldError,
     "field 'mine': ... obstacles"),
    # evaluation
    "value, nan": (lambda: used(cost(np.nan, name="mine")), FieldError,
     "cost 'mine' ... nan ... t = 0.25 s"),
    "value, array": (lambda: used(cost(np.zeros(3))), FieldError,
     "... returned ... [0., 0., 0.] ... t = 0.25 s"),
    "gradient, shape of q": (lambda: used(cost(gradient=np.zeros(6))), FieldError,
     "cost 'function_cost' ... gradient ... (6,) ... (3,)"),
    "gradient, words": (lambda: used(cost(gradient="steep")), FieldError,
     "cost 'function_cost' ... gradient 'steep'"),
    "gradient, nan": (lambda: used(cost(gradient=[0.0, np.nan, 0.0])), FieldError,
     "cost 'function_cost' ... gradient ... nan ... t = 0.25 s"),
    "gradient rate, shape": (
     lambda: used(cost(gradient=np.zeros(3), rate=np.zeros((3, 1)))), FieldError,
     "cost 'function_cost' ... gradient rate ... (3, 1) ... (3,)"),
    "gradient rate, infinite": (
     lambda: used(cost(gradient=np.zeros(3), rate=[0.0, np.inf, 0.0])), FieldError,
     "... gradient rate ... inf ... finite"),
    "own cost, gradient": (lambda: used(Wrong("tip", 0.0, np.zeros(2), name="mine")),
     FieldError, "cost 'mine' ... gradient ... (2,) ... (3,)"),
    "vector, shape": (lambda: used(FunctionField(lambda s: np.zeros(6))), FieldError,
     "field 'function_field' ... g = ... t = 0.25 s ... 3"),
    "vector, number": (lambda: used(FunctionField(lambda s: 1.0)),  # type: ignore
     FieldError, "... g = 1.0"),
    "rate, shape": (lambda: used(
        FunctionField(lambda s: np.zeros(3), rate_function=lambda s: np.zeros(1))),
     FieldError,
     "field 'function_field' ... g' = ... [0.] ... t = 0.25 s ... 3"),
    "rate, infinite": (lambda: used(
     FunctionField(lambda s: np.zeros(3), rate_function=lambda s: np.full(3, np.inf))),
     FieldError, "... g' = ... inf"),
    "in a sum": (lambda: used(Rest() + cost(np.nan, name="mine")), FieldError,
     "cost 'mine' returned nan"),
    "distance, at the centre": (lambda: used(at_the_centre()), FieldError, CENTRE),
    "distance, at the centre, value": (
     lambda: at_the_centre().value(arm().state(0, arm().neutral(), np.zeros(3))),
     FieldError, CENTRE),
}  # fmt: skip


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=wording(message)) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind
