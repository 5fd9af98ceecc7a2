"""Check that wrong arguments and functions of fields are refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from field_cases import evaluate
from field_oracles import OBSTACLE, ValueOnly, load, target
from numpy.typing import NDArray

from hsp_control import (
    EqualJointAngles,
    FunctionCost,
    FunctionField,
    HspControlError,
    IdentityMetric,
    JointCentering,
    MassMatrixMetric,
    Metric,
    NullSpaceField,
    Obstacle,
    PointDistance,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
    Uncontrolled,
    WeightedSum,
)
from hsp_control.common.exceptions import (
    FieldError,
    FrameNotFoundError,
    JointNotFoundError,
    ShapeError,
)
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import (
    FieldSample,
    LimitBarrier,
    Manipulability,
    Ramp,
    StateWeight,
    Transmission,
)
from hsp_control.trajectories import Hold

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]


def arm() -> Robot:
    return load("planar3r")


def used(field: NullSpaceField, metric: Metric | None = None) -> FieldSample:
    robot = field.robot
    state = robot.state(0.25, robot.neutral(), np.ones(robot.nv))
    return evaluate(field, metric or IdentityMetric(), state)


def cost(value: Any = 0.0, **options: Any) -> FunctionCost:
    """Return a cost of the planar arm whose functions return constants."""
    options = {
        key: (lambda s, given=given: given) if key != "name" else given
        for key, given in options.items()
    }
    return FunctionCost(arm(), lambda s: value, **options)


class Wrong(ValueOnly):
    """A cost whose value or gradient is what it is told."""

    def __init__(self, value: Any, gradient: Any = None) -> None:
        super().__init__(arm(), "tip")
        self.given, self.slope = value, gradient

    def value(self, state: RobotState) -> float:
        return self.given

    def gradient(self, state: RobotState) -> Array:
        return super().gradient(state) if self.slope is None else self.slope


def at_the_centre() -> PointDistance:
    tip = arm().state(0.0, arm().neutral(), np.zeros(3)).position("tip").copy()
    ball = Obstacle("ball", Sphere(0.1), Hold(tip))
    return PointDistance(arm(), ["link2", "tip"], ball, name="away")


CENTRE = (
    r"^field 'away': frame 'tip' is at the centre of obstacle 'ball', where the cost "
    r"is infinite$"
)
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    # construction
    "centering, no limits": (
        lambda: JointCentering(arm()),
        FieldError,
        r"^field 'joint_centering': no joint of planar3r has limits, so no range has a "
        r"middle; use a target posture instead$",
    ),
    "centering, negative weight": (
        lambda: JointCentering(load("panda"), weights=-1.0, name="middle"),
        FieldError,
        r"^field 'middle': weights \[-1.0, .*\] must be finite and at least 0$",
    ),
    "centering, infinite weight": (
        lambda: JointCentering(load("panda"), weights=[1, 2, 3, np.inf, 5, 6, 7]),
        FieldError,
        r"must be finite and at least 0$",
    ),
    "centering, number of weights": (
        lambda: JointCentering(load("panda"), weights=[1.0, 2.0]),
        FieldError,
        r"^field 'joint_centering': weights have shape \(2,\); needs one number or 7$",
    ),
    "posture, shape": (
        lambda: TargetPosture(arm(), [0.0, 0.0, 0.0]),
        ShapeError,
        r"^configuration q has shape \(3,\); planar3r needs \(6,\)",
    ),
    "posture, no weight": (
        lambda: TargetPosture(arm(), arm().neutral(), weights=0.0),
        FieldError,
        r"^field 'target_posture': every weight is 0$",
    ),
    "posture, only a root weighted": (
        lambda: TargetPosture(
            load("rolling ur5"),
            load("rolling ur5").neutral(),
            weights=[1.0] * 3 + [0.0] * 6,
        ),
        FieldError,
        r"^field 'target_posture': every weight is 0$",
    ),
    "posture, nan": (
        lambda: TargetPosture(arm(), arm().neutral(), weights=np.nan),
        FieldError,
        r"weights \[nan, nan, nan\] must be finite and at least 0$",
    ),
    "equal angles, one joint": (
        lambda: EqualJointAngles(arm(), ["joint1"]),
        FieldError,
        r"^field 'equal_joint_angles' needs at least two joints; got \['joint1'\]$",
    ),
    "equal angles, weight": (
        lambda: EqualJointAngles(arm(), ["joint1", "joint2"], weight=-0.1),
        FieldError,
        r"^field 'equal_joint_angles': weight -0.1 must be at least 0$",
    ),
    "equal angles, joint": (
        lambda: EqualJointAngles(arm(), ["joint1", "joint4"]),
        JointNotFoundError,
        r"^no joint 'joint4'; did you mean 'joint\d'\?",
    ),
    "equal angles, root": (
        lambda: EqualJointAngles(load("rolling ur5"), ["root_joint", "elbow_joint"]),
        FieldError,
        r"^field 'equal_joint_angles': each joint needs exactly one degree of freedom$",
    ),
    "distance, no frame": (
        lambda: PointDistance(arm(), [], OBSTACLE),
        FieldError,
        r"^field 'point_distance' needs at least one frame$",
    ),
    "distance, frame": (
        lambda: PointDistance(arm(), ["link2", "tipp"], OBSTACLE),
        FrameNotFoundError,
        r"^no frame 'tipp'; did you mean 'tip'\?",
    ),
    "distance, weight": (
        lambda: PointDistance(arm(), ["tip"], OBSTACLE, weight=np.inf),
        FieldError,
        r"^field 'point_distance': weight inf must be at least 0$",
    ),
    "sum, empty": (
        lambda: WeightedSum([]),
        FieldError,
        r"^a sum of fields needs at least one term$",
    ),
    "sum, negative": (
        lambda: -2.0 * Rest(arm()),
        FieldError,
        r"^field 'rest': weight is -2.0; must be at least 0$",
    ),
    "sum, nan": (
        lambda: np.nan * Rest(arm()),
        FieldError,
        r"^field 'rest': weight is nan; must be at least 0$",
    ),
    "sum, uncontrolled": (
        lambda: Uncontrolled(arm()) + Rest(arm()),
        FieldError,
        r"^an uncontrolled null space cannot be part of a sum$",
    ),
    "sum, other robot": (
        lambda: Rest(arm()) + Rest(load("panda")),
        FieldError,
        r"^the fields of a sum belong to different robots$",
    ),
    "sum, other robot inside": (
        lambda: Rest(arm()) + (2.0 * Rest(load("panda"))),
        FieldError,
        r"^the fields of a sum belong to different robots$",
    ),
    "barrier, zone": (
        lambda: LimitBarrier(load("panda"), zone=1.5),
        FieldError,
        r"^field 'limit_barrier': zone 1.5 must be within \(0, 1\]$",
    ),
    "barrier, no limits": (
        lambda: LimitBarrier(arm()),
        FieldError,
        r"^field 'limit_barrier': no joint of planar3r has limits$",
    ),
    "barrier, weight": (
        lambda: LimitBarrier(load("panda"), weights=-1.0),
        FieldError,
        r"^field 'limit_barrier': weights .* must be finite and at least 0$",
    ),
    "manipulability, form": (
        lambda: Manipulability(arm(), "tip", axes="xy", form="square"),  # type: ignore
        FieldError,
        r"^field 'manipulability': form 'square'; choose determinant, root or log$",
    ),
    "manipulability, rows": (
        lambda: Manipulability(arm(), "tip", rows="all"),  # type: ignore
        FieldError,
        r"^field 'manipulability': unknown rows 'all'; choose one of \['position', ",
    ),
    "manipulability, axes": (
        lambda: Manipulability(arm(), "tip", axes="xx"),
        FieldError,
        r"^field 'manipulability': axes 'xx' must be distinct letters of x, y and z$",
    ),
    "manipulability, length": (
        lambda: Manipulability(arm(), "tip", axes="xy", length=0.0),
        FieldError,
        r"^field 'manipulability': length 0.0 must be positive$",
    ),
    "manipulability, too many rows": (
        lambda: Manipulability(arm(), "link2", axes="xyz"),
        FieldError,
        r"^field 'manipulability': 3 rows of frame 'link2', which only 2 degrees of ",
    ),
    "manipulability, frame": (
        lambda: Manipulability(arm(), "tipp"),
        FrameNotFoundError,
        r"^no frame 'tipp'; did you mean 'tip'\?",
    ),
    "transmission, direction": (
        lambda: Transmission(arm(), "tip", [1.0, 0.0, 0.0], axes="xy"),
        FieldError,
        r"^field 'transmission': direction \[1.0, 0.0, 0.0\] needs 2 finite numb",
    ),
    "transmission, kind": (
        lambda: Transmission(arm(), "tip", [1, 0], axes="xy", kind="x"),  # type: ignore
        FieldError,
        r"^field 'transmission': kind 'x'; choose velocity or force$",
    ),
    "ramp, duration": (
        lambda: Ramp(0.0, 1.0, start=0.0, duration=0.0),
        FieldError,
        r"^a ramp from 0.0 s over 0.0 s; needs a finite start and a posi",
    ),
    "ramp, weight": (
        lambda: Ramp(0.0, -1.0, start=0.0, duration=1.0),
        FieldError,
        r"^weight is -1.0; must be at least 0$",
    ),
    # evaluation
    "weight of the state, negative": (
        lambda: used(StateWeight(lambda s: -s.t) * Rest(arm())),
        FieldError,
        r"weight is -0.25; must be at least 0$",
    ),
    "value, nan": (
        lambda: used(cost(np.nan, name="mine")),
        FieldError,
        r"^cost 'mine' returned nan at t = 0.25 s; needs one finite number$",
    ),
    "value, infinite": (
        lambda: cost(-np.inf).value(arm().state(1.5, arm().neutral(), np.zeros(3))),
        FieldError,
        r"^cost 'function' returned -inf at t = 1.5 s; needs one finite number$",
    ),
    "value, none": (lambda: used(cost(None)), FieldError, r"returned None at t = 0.25"),
    "value, array": (
        lambda: used(cost(np.zeros(3))),
        FieldError,
        r"returned array\(\[0., 0., 0.\]\) at t = 0.25 s; needs one finite number",
    ),
    "gradient, shape of q": (
        lambda: used(cost(gradient=np.zeros(6))),
        FieldError,
        r"^cost 'function' has a gradient of shape \(6,\); needs \(3,\): the tangent "
        r"space, not the configuration$",
    ),
    "gradient, number": (
        lambda: used(cost(gradient=1.0)),
        FieldError,
        r"^cost 'function' has a gradient of shape \(\); needs \(3,\)",
    ),
    "gradient, words": (
        lambda: used(cost(gradient="steep")),
        FieldError,
        r"^cost 'function' has the gradient 'steep'; needs numbers$",
    ),
    "gradient, nan": (
        lambda: used(cost(gradient=[0.0, np.nan, 0.0])),
        FieldError,
        r"^cost 'function' has the gradient .*nan.* at t = 0.25 s; needs finite num",
    ),
    "gradient, nan, mass matrix": (
        lambda: used(cost(gradient=[0.0, np.nan, 0.0]), MassMatrixMetric()),
        FieldError,
        r"needs finite numbers$",
    ),
    "gradient rate, shape": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=np.zeros((3, 1)))),
        FieldError,
        r"^cost 'function' has a gradient rate of shape \(3, 1\); needs \(3,\)",
    ),
    "gradient rate, number": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=0.0)),
        FieldError,
        r"^cost 'function' has a gradient rate of shape \(\); needs \(3,\)",
    ),
    "gradient rate, infinite": (
        lambda: used(cost(gradient=np.zeros(3), gradient_rate=[0.0, np.inf, 0.0])),
        FieldError,
        r"the gradient rate .*inf.*; needs finite numbers$",
    ),
    "own cost, nan": (
        lambda: used(Wrong(np.nan)),
        FieldError,
        r"^cost 'value_only' has the gradient .*nan.*; needs finite numbers$",
    ),
    "own cost, gradient": (
        lambda: used(Wrong(0.0, np.zeros(2))),
        FieldError,
        r"^cost 'value_only' has a gradient of shape \(2,\); needs \(3,\)",
    ),
    "vector, shape": (
        lambda: used(FunctionField(arm(), lambda s: np.zeros(6))),
        FieldError,
        r"^field 'function' returned g = array\(\[0., .*\]\) at t = 0.25 s; needs 3 "
        r"finite numbers$",
    ),
    "vector, number": (
        lambda: used(FunctionField(arm(), lambda s: 1.0)),  # type: ignore
        FieldError,
        r"returned g = 1.0 at t",
    ),
    "vector, words": (
        lambda: used(FunctionField(arm(), lambda s: "fast")),  # type: ignore
        FieldError,
        r"returned g = 'fast' at t",
    ),
    "vector, nan": (
        lambda: used(FunctionField(arm(), lambda s: np.full(3, np.nan))),
        FieldError,
        r"returned g = array\(\[nan, nan, nan\]\)",
    ),
    "rate, shape": (
        lambda: used(
            FunctionField(arm(), lambda s: np.zeros(3), rate=lambda s: np.zeros(1))
        ),
        FieldError,
        r"^field 'function' returned g' = array\(\[0.\]\) at t = 0.25 s; needs 3",
    ),
    "rate, infinite": (
        lambda: used(
            FunctionField(
                arm(), lambda s: np.zeros(3), rate=lambda s: np.full(3, np.inf)
            )
        ),
        FieldError,
        r"returned g' = array\(\[inf, inf, inf\]\)",
    ),
    "in a sum": (
        lambda: used(Rest(arm()) + cost(np.nan, name="mine")),
        FieldError,
        r"^cost 'mine' returned nan",
    ),
    "distance, at the centre": (lambda: used(at_the_centre()), FieldError, CENTRE),
    "distance, at the centre, value": (
        lambda: at_the_centre().value(arm().state(0, arm().neutral(), np.zeros(3))),
        FieldError,
        CENTRE,
    ),
}


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=message) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind


def test_a_user_s_own_exception_passes() -> None:
    """What goes wrong in a user's function is told as it is."""

    def fails(state: RobotState) -> float:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match=r"^mine$"):
        used(FunctionCost(arm(), fails))


def test_arguments_are_copied() -> None:
    goal, w = target("planar3r"), np.ones(3)
    field = TargetPosture(arm(), goal, weights=w)
    state = arm().state(0.0, target("planar3r"), np.zeros(3))
    goal[:] = arm().neutral()
    w[:] = 7.0
    np.testing.assert_allclose(field.gradient(state), 0.0, atol=1e-15)
    moved = arm().state(0.0, arm().integrate(state.q, np.full(3, 0.1)), np.zeros(3))
    np.testing.assert_allclose(field.gradient(moved), np.sin(0.1), rtol=1e-12)
