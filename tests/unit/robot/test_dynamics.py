"""The engine's dynamics against Pinocchio's bindings, for robots of every kind.

Both run the same algorithms, compiled with other flags: they agree to rounding.
"""

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from robot_cases import ROBOTS, draw

from hsp_control import Robot, engine
from hsp_control.common.arrays import Array
from hsp_control.robot.dynamics import dynamics_of, model_numbers
from hsp_control.robot.gravity import Gravity

KNOWN = {
    "slide": pin.JointModelPY(),
    "slide, tilted": pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
    "screw": pin.JointModelHX(0.3),
    "screw, tilted": pin.JointModelHelicalUnaligned(np.array([0.6, 0.8, 0.0]), 0.3),
    "turns, tilted": pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])),
    "turns often": pin.JointModelRUBY(),
    "ball": pin.JointModelSpherical(),
    "planar": pin.JointModelPlanar(),
    "translation": pin.JointModelTranslation(),
    "free-flyer": pin.JointModelFreeFlyer(),
}


def chain_with(joint: object) -> pin.Model:
    """Return a chain of three bodies whose middle joint is the given one."""
    model, parent, rng = pin.Model(), 0, np.random.default_rng(3)
    for k, each in enumerate((pin.JointModelRZ(), joint, pin.JointModelRX())):
        place = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3)), rng.random(3))
        parent = model.addJoint(parent, each, place, f"joint{k}")
        body = pin.SE3(np.eye(3), rng.random(3))
        model.appendBodyToJoint(parent, pin.Inertia.FromBox(2.0, 0.3, 0.2, 0.1), body)
    model.armature = rng.random(model.nv)
    return model


def compare(model: pin.Model, q: Array, v: Array, a: Array) -> None:
    """Check every call of the engine at a state, with new Pinocchio data."""
    nv, x = model.nv, model.nvExtended
    own, data = dynamics_of(model), model.createData()
    near = {"rtol": 1e-11, "atol": 1e-11 * max(1.0, float(np.abs(v).max())) ** 2}

    J, J_dot = np.zeros((6, x), order="F"), np.zeros((6, x), order="F")
    places = np.zeros((model.njoints, 12))
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    at = {"dynamics": own, "q": q, "v": v}
    given = {"jacobian": J, "jacobian_dot": J_dot, "placements": places}
    engine.JointJacobians(**at, **given)()
    assert_allclose(J, np.reshape(data.J, (6, x)), **near)
    assert_allclose(J_dot, np.reshape(data.dJ, (6, x)), **near)
    for place, expected in zip(places, data.oMi, strict=True):
        assert_allclose(place[:9].reshape(3, 3).T, expected.rotation, **near)
        assert_allclose(place[9:], expected.translation, **near)

    effort, M, acceleration = np.zeros(nv), np.zeros((nv, nv)), np.zeros(nv)
    engine.InverseDynamics(**at, acceleration=a, effort=effort)()
    scale = 1e-12 * float(np.abs(effort).max()) + 1e-12
    assert_allclose(
        effort, pin.rnea(model, model.createData(), q, v, a), rtol=0, atol=scale
    )
    engine.MassMatrix(dynamics=own, q=q, M=M)()
    assert_allclose(M, pin.crba(model, model.createData(), q), **near)
    engine.ForwardDynamics(**at, effort=effort, acceleration=acceleration)()
    conditioned = 1e-14 * float(np.linalg.cond(M)) * float(np.abs(effort).max() + 1.0)
    assert_allclose(acceleration, a, rtol=0, atol=1e-10 + conditioned)
    if len(model.mimicking_joints):
        return
    M_dot = np.zeros((nv, nv))
    engine.MassMatrixRate(**at, M_dot=M_dot)()
    C = np.reshape(pin.computeCoriolisMatrix(model, data, q, v), (nv, nv))
    assert_allclose(M_dot, C + C.T, rtol=0, atol=1e-11 * float(np.abs(C).max() + 1.0))


@pytest.mark.parametrize("case", ROBOTS)
def test_terms_are_those_of_pinocchios_bindings(case: str) -> None:
    robot, q, v, rng = draw(case, seed=21)
    compare(robot.model, q, v, rng.standard_normal(robot.nv))


@pytest.mark.parametrize("joint", KNOWN)
def test_every_type_of_joint_steps(joint: str) -> None:
    model = chain_with(KNOWN[joint])
    rng = np.random.default_rng(4)
    q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
    compare(model, q, *rng.standard_normal((2, model.nv)))


@pytest.mark.parametrize("case", ROBOTS)
def test_gravity_has_the_slope_and_the_drift_of_its_differences(case: str) -> None:
    robot, q, v, _ = draw(case, seed=5)
    state, rest = robot.state(0.0, q, v), np.zeros(robot.nv)
    gravity = Gravity(robot.model, state.dynamics, state.world)
    state.run(gravity.calls)

    def efforts(displacement: Array) -> Array:
        return robot.inverse_dynamics(robot.integrate(q, displacement), rest, rest)

    scale = 1.0 + float(np.abs(gravity.effort).max())
    assert_allclose(gravity.effort, efforts(rest), rtol=0, atol=1e-12 * scale)
    h = 1e-4
    steps = h * np.eye(robot.nv)
    columns = [(efforts(step) - efforts(-step)) / (2.0 * h) for step in steps]
    assert_allclose(gravity.slope, np.array(columns).T, rtol=0, atol=1e-7 * scale)
    # At the fourth order: with h = 1e-3 errors are near 1e-16/h² and h⁴ v⁶.
    h = 1e-3
    near, far = (efforts(s * v) + efforts(-s * v) for s in (h, 2.0 * h))
    expected = (16.0 * near - far - 30.0 * gravity.effort) / (12.0 * h**2)
    assert_allclose(gravity.drift, expected, rtol=0, atol=1e-7 * scale)


def test_a_copy_computes_in_separate_memory() -> None:
    robot, q, v, rng = draw("panda", seed=22)
    a, effort = rng.standard_normal(7), np.zeros(7)
    at = {"dynamics": robot.dynamics(), "q": q, "v": v}
    call = engine.InverseDynamics(**at, acceleration=a, effort=effort)
    expected = robot.inverse_dynamics(q, v, a)
    for other in (copy.deepcopy(call), pickle.loads(pickle.dumps(call))):
        other()
        assert_allclose(effort, 0.0)
        assert_allclose(other.values["effort"], expected, rtol=0, atol=0)


def test_sizes_of_another_robot_are_refused() -> None:
    robot, q, v, _ = draw("panda", seed=23)
    own, J = robot.dynamics(), np.zeros((6, 7), order="F")
    others = {"v": v, "acceleration": v, "effort": np.zeros(7)}
    with pytest.raises(ValueError, match="8 and 7 entries; this robot's have 7 and 7"):
        engine.InverseDynamics(dynamics=own, q=np.zeros(8), **others)
    given = {
        "jacobian": J,
        "jacobian_dot": J.copy("F"),
        "placements": np.zeros((3, 12)),
    }
    with pytest.raises(ValueError, match="7 columns and 8 joints"):
        engine.JointJacobians(dynamics=own, q=q, v=v, **given)
    with pytest.raises(TypeError, match="dynamics is a Dynamics; got None"):
        engine.InverseDynamics(dynamics=None, q=q, **others)


def test_numbers_that_are_no_robot_are_refused() -> None:
    joints, gravity, armature = model_numbers(draw("panda", seed=24)[0].model)
    with pytest.raises(ValueError, match="JointModelWheel, which the engine does not"):
        engine.Dynamics((joints[0]._replace(type="JointModelWheel"),), gravity, ())
    with pytest.raises(ValueError, match="its parent is number 5; must come before"):
        engine.Dynamics((joints[0]._replace(parent=5),), gravity, armature[:1])
    with pytest.raises(ValueError, match="its leader is number -2; must come before"):
        engine.Dynamics((joints[0]._replace(leader=-2),), gravity, armature[:1])
    with pytest.raises(ValueError, match="armature has 6 entries; needs 7"):
        engine.Dynamics(joints, gravity, armature[1:])


def test_dynamics_are_those_of_the_model_as_it_is_now() -> None:
    """The model's numbers are read once, and again after a change."""
    robot = Robot.load("panda")
    q, zero = robot.home(), np.zeros(7)

    def heavier(model: pin.Model) -> None:
        model.inertias[6].mass *= 1.0 + 1e-9

    def rotors(model: pin.Model) -> None:
        model.armature[3] += 1e-3

    def tilted(model: pin.Model) -> None:
        model.gravity.linear = np.array([1.0, 0.0, -9.81])

    def moved(model: pin.Model) -> None:
        model.jointPlacements[5].translation += 1e-6

    for change in (heavier, rotors, tilted, moved):
        before = robot.inverse_dynamics(q, zero, np.ones(7), robot.dynamics())
        change(robot.model)
        data = robot.model.createData()
        expected = pin.rnea(robot.model, data, q, zero, np.ones(7))
        for _ in range(2):
            found = robot.inverse_dynamics(q, zero, np.ones(7), robot.dynamics())
            assert_allclose(found, expected, rtol=0, atol=1e-12)
        assert not np.array_equal(before, found), change.__name__
