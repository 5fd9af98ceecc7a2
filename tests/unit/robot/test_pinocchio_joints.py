"""Every Pinocchio joint has exact rates, or is refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError

ZERO = np.zeros(3)
TILTED = np.array([0.6, 0.8, 0.0])


def composite(*joints: Any) -> Any:
    made = pin.JointModelComposite()
    for each in joints:
        made.addJoint(each)
    return made


KEPT: dict[str, Callable[[], Any]] = {
    "revolute": pin.JointModelRX,
    "revolute, tilted": lambda: pin.JointModelRevoluteUnaligned(TILTED),
    "continuous": pin.JointModelRUBZ,
    "prismatic": lambda: pin.JointModelPrismaticUnaligned(TILTED),
    "helical": lambda: pin.JointModelHelicalUnaligned(TILTED, 0.3),
    "planar": pin.JointModelPlanar,
    "translation": pin.JointModelTranslation,
    "ball": pin.JointModelSpherical,
    "free-flyer": pin.JointModelFreeFlyer,
}
REFUSED: dict[str, Callable[[], Any]] = {
    "JointModelSphericalZYX": pin.JointModelSphericalZYX,
    "JointModelUniversal": lambda: pin.JointModelUniversal(
        np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    ),
    "JointModelComposite": lambda: composite(pin.JointModelRX(), pin.JointModelRY()),
    "JointModelEllipsoid": lambda: pin.JointModelEllipsoid(0.1, 0.2, 0.3),
}


def model_with(joint: Any) -> pin.Model:
    """Return an arm whose middle joint is the given one."""
    model, parent, rng = pin.Model(), 0, np.random.default_rng(6)
    for k, each in enumerate((pin.JointModelRY(), joint, pin.JointModelRZ())):
        place = pin.SE3(
            pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3)), rng.uniform(size=3)
        )
        parent = model.addJoint(parent, each, place, f"joint{k}")
        body = pin.SE3(np.eye(3), rng.uniform(size=3))
        model.appendBodyToJoint(parent, pin.Inertia.FromBox(2.0, 0.3, 0.2, 0.1), body)
        model.addBodyFrame(f"link{k}", parent, body, 0)
    return model


@pytest.mark.parametrize("kind", KEPT)
def test_rates_are_those_of_differences(kind: str) -> None:
    robot, rng = (
        Robot.from_pinocchio(model_with(KEPT[kind]())),
        np.random.default_rng(7),
    )
    q = robot.random_configuration(rng)
    v = rng.standard_normal(robot.nv)
    h = 1e-4

    def terms(s: float) -> tuple[Array, Array]:
        state = robot.state(0.0, robot.integrate(q, s * v), v)
        return state.frame("link2").jacobian.copy(), state.mass_matrix.copy()

    state = robot.state(0.0, q, v)
    ahead, behind = terms(h), terms(-h)
    for found, one, other in zip(
        (state.frame("link2").jacobian_dot, state.mass_matrix_rate), ahead, behind,
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(found, (one - other) / (2.0 * h), rtol=0, atol=1e-5)


@pytest.mark.parametrize("kind", REFUSED)
def test_joints_whose_axes_turn_with_them_are_refused_by_name(kind: str) -> None:
    message = f"joint 'joint1' is a {kind}, whose motion subspace depends on"
    with pytest.raises(ModelError, match=message):
        Robot.from_pinocchio(model_with(REFUSED[kind]()))


def test_a_translation_has_three_lengths() -> None:
    robot = Robot.from_pinocchio(model_with(pin.JointModelTranslation()))
    assert robot.dof_names[1:4] == ("joint1.x", "joint1.y", "joint1.z")
    assert robot.units == ("rad", "m", "m", "m", "rad")


def sliding() -> Robot:
    """A joint of three slides within limits, and a revolute joint on it."""
    model = pin.Model()
    slide = model.addJoint(
        0, pin.JointModelTranslation(), pin.SE3.Identity(), "slide",
        np.full(3, 100.0), np.full(3, 1.0), np.full(3, -0.2), np.array([0.2, 0.2, 0.3]),
    )  # fmt: skip
    model.appendBodyToJoint(
        slide, pin.Inertia(2.0, ZERO, np.eye(3)), pin.SE3.Identity()
    )
    turn = model.addJoint(
        slide, pin.JointModelRY(), pin.SE3.Identity(), "turn",
        np.full(1, 10.0), np.full(1, 2.0), np.full(1, -2.0), np.full(1, 2.0),
    )  # fmt: skip
    arm = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    model.appendBodyToJoint(turn, pin.Inertia(1.0, ZERO, 0.01 * np.eye(3)), arm)
    model.addFrame(pin.Frame("tip", turn, 0, arm, pin.FrameType.BODY))
    return Robot.from_pinocchio(model, end_effector="tip")


def test_the_slides_of_a_translation_keep_their_limits() -> None:
    """The hand is commanded to 0.9 m; the slide's limit is 0.2 m."""
    robot = sliding()
    lower, upper = robot.position_limits()
    np.testing.assert_array_equal(lower, [-0.2, -0.2, -0.2, -2.0])
    np.testing.assert_array_equal(upper, [0.2, 0.2, 0.3, 2.0])
    assert robot.dof_indices.tolist() == [0, 1, 2, 3]
    gains = hsp.Gains(natural_frequency=8.0)
    task = hsp.FramePosition("tip", [0.9, 0.0, 0.1], gains=gains)
    law = hsp.Controller(robot, [task], limits=hsp.Limits())
    run = hsp.simulate(law, robot.neutral(), duration=2.0)
    assert (np.abs(run.q[:, 0]) < 0.2).all()
    assert run.q[-1, 0] > 0.18


def test_a_follower_along_a_screw_is_refused_by_name() -> None:
    model = pin.transformJointIntoMimic(chain_of_screws(), 1, 3, 0.7, 0.2)
    with pytest.raises(ModelError, match="'screw3' follows another one along a screw"):
        Robot.from_pinocchio(model)


def chain_of_screws() -> pin.Model:
    model, parent = pin.Model(), 0
    place = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    for k in range(3):
        joint = pin.JointModelHX(0.3)
        parent = model.addJoint(parent, joint, place, f"screw{k + 1}")
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), place)
    return model


def tree(order: str) -> pin.Model:
    """Return joints a, b beside it, and c on a, added in some order."""
    model, added, below = pin.Model(), {"": 0}, {"a": "", "b": "", "c": "a"}
    for name in order:
        place = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.3]))
        parent = added[below[name]]
        added[name] = model.addJoint(parent, pin.JointModelRY(), place, name)
        body = pin.Inertia.FromBox(1.0, 0.3, 0.2, 0.1)
        model.appendBodyToJoint(added[name], body, place)
        model.addBodyFrame(f"link_{name}", added[name], pin.SE3.Identity(), 0)
    return model


@pytest.mark.parametrize("order", ["acb", "bac"])
def test_joints_of_a_tree_in_their_order_have_the_right_mass_matrix(order: str) -> None:
    robot = Robot.from_pinocchio(tree(order))
    q, rest = np.full(3, 0.3), np.zeros(3)
    held = robot.inverse_dynamics(q, rest, rest)
    columns = [robot.inverse_dynamics(q, rest, a) - held for a in np.eye(3)]
    np.testing.assert_allclose(robot.mass_matrix(q), np.array(columns).T, atol=1e-14)


def test_joints_between_others_and_what_is_below_them_are_refused() -> None:
    """Pinocchio's CRBA would leave out the inertia between a and c."""
    message = "joint 'c' follows 'b', but is below 'a', which 'b' is not"
    with pytest.raises(ModelError, match=message):
        Robot.from_pinocchio(tree("abc"))
