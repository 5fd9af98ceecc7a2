"""The robot and its state: against Pinocchio, differences, energy and a second engine.

Robots are of every kind that the package meets: fixed, planar and floating roots,
continuous joints (nq ≠ nv) and joints that mimic others.
"""

import copy
import gc
import itertools
import pickle
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from oracles import gradient, slope
from refused_robots import REFUSED

from hsp_control import HspControlError, Robot, RobotState
from hsp_control.common.exceptions import (
    ConfigurationError,
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
    NonFiniteError,
    ShapeError,
)
from hsp_control.robot.description.loading import load_model
from hsp_control.robot.description.sources import (
    RobotSource,
    example_robots,
    find_robot,
)

Array = NDArray[np.float64]
LWA = pin.LOCAL_WORLD_ALIGNED

BUNDLED = ("planar3r", "panda", "iiwa14")
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "planar3r": ("planar3r", {}),  # three continuous joints
    "panda": ("panda", {}),
    "panda_fingers": ("panda", {"locked": {}}),  # one finger mimics the other
    "iiwa14": ("iiwa14", {}),
    "ur5": ("ur5", {}),
    "tiago": ("tiago", {}),  # two continuous joints among 48
    "tiago_pro": ("tiago_pro", {}),  # continuous and mimic joints
    "talos_arm_planar": ("talos_arm", {"root": "planar"}),
    "talos_arm_free_flyer": ("talos_arm", {"root": "free_flyer"}),
    "panda_fingers_free_flyer": ("panda", {"locked": {}, "root": "free_flyer"}),
    "solo12": ("solo12", {}),
}
FLAT = ("planar3r", "panda", "panda_fingers", "iiwa14", "ur5", "tiago_pro")


@cache
def load(case: str) -> Robot:
    name, options = ROBOTS[case]
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    return Robot.load(name, **options)


def draw(case: str, seed: int) -> tuple[Robot, Array, Array, np.random.Generator]:
    """Return a robot at a random configuration and velocity."""
    robot, rng = load(case), np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    return robot, q, rng.standard_normal(robot.nv), rng


def frames(robot: Robot, rng: np.random.Generator) -> list[str]:
    """Return four frames at random and the last: it often hangs on a mimic joint."""
    chosen = rng.choice(len(robot.frame_names), 4, replace=False)
    return [robot.frame_names[i] for i in chosen] + [robot.frame_names[-1]]


def step_of(v: Array) -> float:
    """Return a step [s] in which the joints together turn by 0.01 rad.

    The differences of `oracles.slope` then err by 1e-14 in theory, 1e-13 by rounding.
    """
    return 0.01 / max(1.0, float(np.abs(v).sum()))


def everything(state: RobotState, frame: str) -> dict[str, Array]:
    """Return copies of all that a state offers."""
    kinematics = state.frame(frame)
    names = ("rotation", "position", "jacobian", "jacobian_dot", "velocity", "drift")
    terms = {name: np.array(getattr(kinematics, name)) for name in names}
    terms["mass_matrix"] = state.mass_matrix.copy()
    terms["mass_matrix_rate"] = state.mass_matrix_rate.copy()
    terms["nonlinear_effects"] = state.nonlinear_effects.copy()
    terms["effort"] = state.inverse_dynamics(np.ones(state.robot.nv)).copy()
    return terms


def assert_equal_terms(
    actual: dict[str, Array], expected: dict[str, Array], atol: float = 0.0
) -> None:
    assert actual.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(
            actual[name], value, rtol=atol, atol=atol, err_msg=name
        )


# --- frames --------------------------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
def test_frames_equal_pinocchios(case: str) -> None:
    """Placement, J, J', velocity and classical acceleration (of v' = 0).

    But for J' where joints mimic others, which Pinocchio gets wrong (by 3.6 on
    tiago_pro); there the differences of the next tests decide.
    """
    robot, q, v, rng = draw(case, seed=1)
    model, data = robot.model, robot.model.createData()
    state = robot.state(0.3, q, v)
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.forwardKinematics(model, data, q, v, np.zeros(robot.nv))
    pin.updateFramePlacements(model, data)
    for name in frames(robot, rng):
        frame, index = state.frame(name), model.getFrameId(name)
        # 1e-13 of entries up to 10: the same sums in another order.
        expected = {
            "rotation": data.oMf[index].rotation,
            "position": data.oMf[index].translation,
            "jacobian": pin.getFrameJacobian(model, data, index, LWA),
            "jacobian_dot": pin.getFrameJacobianTimeVariation(model, data, index, LWA),
            "velocity": pin.getFrameVelocity(model, data, index, LWA).vector,
            "drift": pin.getFrameClassicalAcceleration(model, data, index, LWA).vector,
        }
        if robot.mimics:
            del expected["jacobian_dot"]
        for what, value in expected.items():
            np.testing.assert_allclose(
                getattr(frame, what), value, rtol=1e-13, atol=1e-13, err_msg=what
            )


@pytest.mark.parametrize("case", ROBOTS)
def test_frame_jacobian_is_the_derivative_of_the_placement(case: str) -> None:
    """J e_i by differences of position and rotation along q ⊕ s e_i."""
    robot, q, v, rng = draw(case, seed=2)
    state = robot.state(0.0, q, v)
    for name in frames(robot, rng):
        frame = state.frame(name)
        R, J = frame.rotation.copy(), frame.jacobian.copy()

        def moved(s: float, unit: Array, name: str = name, R: Array = R) -> Array:
            there = state.displaced(0.0, s * unit).frame(name)
            turned = pin.log3(there.rotation @ R.T)  # in world axes
            return np.concatenate([there.position, turned])

        columns = [
            slope(lambda s, u=unit: moved(s, u), 0.01) for unit in np.eye(robot.nv)
        ]
        # Rounding of the differences: 2e-16 of 5 m over 0.01 rad.
        np.testing.assert_allclose(J, np.array(columns).T, rtol=0, atol=1e-12)


@pytest.mark.parametrize("case", ROBOTS)
def test_frame_rates_are_derivatives_along_the_flow(case: str) -> None:
    """J', velocity and drift by differences along q ⊕ s v."""
    robot, q, v, rng = draw(case, seed=3)
    state, step = robot.state(0.0, q, v), step_of(v)
    for name in frames(robot, rng):
        frame = state.frame(name)

        def ahead(s: float, name: str = name) -> Any:
            return state.ahead(s).frame(name)

        # Rounding: 2e-16 of J (5 m) over 0.01/Σ|v| s, up to 3e-4 s for 48 joints.
        scale = np.abs(v).sum()
        J_dot = slope(lambda s: ahead(s).jacobian, step)
        np.testing.assert_allclose(
            frame.jacobian_dot, J_dot, rtol=0, atol=1e-12 * scale
        )
        velocity = slope(lambda s: ahead(s).position, step)
        np.testing.assert_allclose(frame.velocity[:3], velocity, rtol=0, atol=2e-11)
        drift = slope(lambda s: ahead(s).velocity, step)
        np.testing.assert_allclose(frame.drift, drift, rtol=0, atol=1e-12 * scale**2)
        np.testing.assert_allclose(
            frame.velocity, frame.jacobian @ v, rtol=1e-13, atol=1e-13
        )


def test_position_is_the_frames() -> None:
    robot, q, v, _ = draw("panda", seed=4)
    state = robot.state(0.0, q, v)
    np.testing.assert_array_equal(
        state.position("panda_hand"), state.frame("panda_hand").position
    )


# --- dynamics ------------------------------------------------------------------------


def mass_matrix_by_bodies(state: RobotState) -> Array:
    """Return Σ m J_cᵀJ_c + J_wᵀ R I Rᵀ J_w + armature, from the frames' Jacobians."""
    robot = state.robot
    M = np.diag(np.array(robot.model.armature[: robot.nv]))
    for name, inertia in zip(robot.model.names, robot.model.inertias, strict=True):
        frame = state.frame(name)
        J_v, J_w = frame.jacobian[:3], frame.jacobian[3:]
        J_c = J_v - pin.skew(frame.rotation @ inertia.lever) @ J_w
        I_world = frame.rotation @ inertia.inertia @ frame.rotation.T
        M += inertia.mass * J_c.T @ J_c + J_w.T @ I_world @ J_w
    return M


@pytest.mark.parametrize("case", ROBOTS)
def test_mass_matrix_is_the_kinetic_energy_of_the_bodies(case: str) -> None:
    robot, q, v, _ = draw(case, seed=5)
    state = robot.state(0.0, q, v)
    expected = mass_matrix_by_bodies(state)
    M = state.mass_matrix
    # 1e-13 of the largest entry, up to 80 kg m²: sums in another order.
    atol = 1e-13 * np.abs(expected).max()
    np.testing.assert_allclose(M, expected, rtol=0, atol=atol)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M)[0] > 0.0


@pytest.mark.parametrize("case", ROBOTS)
def test_mass_matrix_rate_is_the_derivative_along_the_flow(case: str) -> None:
    robot, q, v, _ = draw(case, seed=6)
    state = robot.state(0.0, q, v)
    expected = slope(lambda s: state.ahead(s).mass_matrix, step_of(v))
    # Rounding: 2e-16 of M over 0.01/Σ|v| s; for mimic joints both are differences.
    atol = 1e-12 * np.abs(state.mass_matrix).max() * np.abs(v).sum()
    np.testing.assert_allclose(state.mass_matrix_rate, expected, rtol=0, atol=atol)
    assert np.abs(expected).max() > 1e3 * atol  # there is something to see


@pytest.mark.parametrize("case", ROBOTS)
def test_nonlinear_effects_are_the_effort_of_no_acceleration(case: str) -> None:
    robot, q, v, _ = draw(case, seed=7)
    data = robot.model.createData()
    expected = pin.rnea(robot.model, data, q, v, np.zeros(robot.nv))
    effects = robot.state(0.0, q, v).nonlinear_effects
    np.testing.assert_allclose(effects, expected, rtol=1e-13, atol=1e-12)


def potential_energy(state: RobotState) -> float:
    """Return -Σ m gᵀc, from the frames' placements."""
    model, total = state.robot.model, 0.0
    for name, inertia in zip(model.names, model.inertias, strict=True):
        frame = state.frame(name)
        center = frame.position + frame.rotation @ inertia.lever
        total -= inertia.mass * model.gravity.linear @ center
    return total


@pytest.mark.parametrize("case", FLAT)
def test_nonlinear_effects_are_lagranges(case: str) -> None:
    """N = M'v - ½ ∇(vᵀMv) + ∇U, all by differences of M and U (flat spaces only)."""
    robot, q, v, _ = draw(case, seed=8)
    state = robot.state(0.0, q, v)

    def lagrangian(displacement: Array) -> float:
        there = state.displaced(0.0, displacement)
        return float(0.5 * v @ there.mass_matrix @ v) - potential_energy(there)

    M_dot = slope(lambda s: state.ahead(s).mass_matrix, step_of(v))
    expected = M_dot @ v - gradient(lagrangian, robot.nv, 0.01)
    # Rounding of the differences: 2e-16 of U (up to 400 J) over 0.01 rad, and M'.
    scale = max(400.0, np.abs(state.mass_matrix).max() * np.abs(v).sum() ** 2)
    np.testing.assert_allclose(
        state.nonlinear_effects, expected, rtol=0, atol=1e-12 * scale
    )


@pytest.mark.parametrize("case", ROBOTS)
def test_inverse_dynamics_is_m_a_plus_n_and_forward_dynamics_undoes_it(
    case: str,
) -> None:
    robot, q, v, rng = draw(case, seed=9)
    state, a = robot.state(0.0, q, v), rng.standard_normal(robot.nv)
    tau = state.inverse_dynamics(a)
    expected = state.mass_matrix @ a + state.nonlinear_effects
    scale = np.abs(expected).max()
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(
        robot.inverse_dynamics(q, v, a), tau, rtol=0, atol=1e-13 * scale
    )
    # Solving loses what the condition number says: at most 1e6 here.
    back = robot.forward_dynamics(q, v, tau)
    cond = np.linalg.cond(state.mass_matrix)
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-14 * cond + 1e-12)


def test_forward_dynamics_of_a_fixed_robot_is_aba() -> None:
    robot, q, v, rng = draw("panda", seed=10)
    tau = rng.standard_normal(7)
    expected = pin.aba(robot.model, robot.model.createData(), q, v, tau)
    np.testing.assert_array_equal(robot.forward_dynamics(q, v, tau), expected)


def test_mimic_fingers_carry_both_fingers_inertia() -> None:
    """G = ∂(free joints)/∂(own freedoms) gives M = GᵀM_f G, N = GᵀN_f, J = J_f G."""
    robot, q, v, _ = draw("panda_fingers", seed=11)
    free = Robot.load("panda", locked={}, mimic=False)
    G = np.vstack([np.eye(8), np.eye(8)[7]])
    state = robot.state(0.0, q, v)
    other = free.state(0.0, np.append(q, q[7]), G @ v)
    frame, same = (s.frame("panda_rightfinger") for s in (state, other))
    pairs = [
        (state.mass_matrix, G.T @ other.mass_matrix @ G),
        (state.mass_matrix_rate, G.T @ other.mass_matrix_rate @ G),
        (state.nonlinear_effects, G.T @ other.nonlinear_effects),
        (frame.jacobian, same.jacobian @ G),
        (frame.jacobian_dot, same.jacobian_dot @ G),
        (frame.drift, same.drift),
    ]
    for actual, expected in pairs:
        # 1e-11: the mass matrix' rate is by differences where joints mimic others.
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-11)


# --- a second engine -----------------------------------------------------------------


def mujoco_model(robot: Robot) -> Any:
    """Return MuJoCo's own reading of the URDF, without what only MuJoCo adds."""
    mujoco = pytest.importorskip("mujoco")
    tree = ElementTree.parse(robot.source.urdf)
    for link in tree.getroot().findall("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
    text = ElementTree.tostring(tree.getroot(), encoding="unicode")
    model = mujoco.MjModel.from_xml_string(text)
    model.dof_damping[:] = 0.0
    model.dof_frictionloss[:] = 0.0
    model.jnt_limited[:] = 0
    model.eq_active0[:] = 0
    return model


@pytest.mark.parametrize("name", BUNDLED)
@pytest.mark.parametrize("seed", range(3))
def test_dynamics_equal_mujocos(name: str, seed: int) -> None:
    """M, N, forward dynamics, J and J' of the last body, by another engine."""
    mujoco = pytest.importorskip("mujoco")
    robot = Robot.load(name, locked={}, mimic=False)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    names = [
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i)
        for i in range(model.njnt)
    ]
    assert names == list(robot.joint_names)
    rng = np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    v, tau = rng.standard_normal((2, robot.nv))
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = robot.joint_positions(q), v, tau
    mujoco.mj_forward(model, data)
    state = robot.state(0.0, q, v)

    # MuJoCo lifts the point masses' inertia to 1e-12 kg m²; the rest is rounding.
    M = np.zeros((robot.nv, robot.nv))
    if hasattr(data, "qM"):  # MuJoCo 3
        mujoco.mj_fullM(model, M, data.qM)
    else:
        mujoco.mj_fullM(model, data, M)
    np.testing.assert_allclose(state.mass_matrix, M, rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        state.nonlinear_effects, data.qfrc_bias, rtol=0, atol=1e-11
    )
    acceleration = robot.forward_dynamics(q, v, tau)
    scale = np.abs(acceleration).max()
    np.testing.assert_allclose(acceleration, data.qacc, rtol=0, atol=1e-9 * scale)

    body = model.nbody - 1
    link = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    frame, point = state.frame(link), data.xpos[body].copy()
    np.testing.assert_allclose(frame.position, point, rtol=0, atol=1e-13)
    for function, expected in (
        (mujoco.mj_jac, frame.jacobian),
        (mujoco.mj_jacDot, frame.jacobian_dot),
    ):
        linear, angular = np.zeros((2, 3, robot.nv))
        function(model, data, linear, angular, point, body)
        np.testing.assert_allclose(
            np.vstack([linear, angular]), expected, rtol=0, atol=1e-12
        )


# --- one state, many moves -----------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
def test_update_moves_everything(case: str) -> None:
    """A used state that is moved equals a fresh one there, to the last bit."""
    robot, q, v, rng = draw(case, seed=12)
    frame = robot.frame_names[-1]
    used = robot.state(0.0, q, v)
    everything(used, frame)
    for _ in range(3):
        q, v = robot.random_configuration(rng), rng.standard_normal(robot.nv)
        t = float(rng.uniform())
        assert used.update(t, q, v) is used
        assert used.t == t
        np.testing.assert_array_equal(used.q, q)
        np.testing.assert_array_equal(used.v, v)
        fresh = robot.state(t, q, v)
        assert_equal_terms(everything(used, frame), everything(fresh, frame))


@pytest.mark.parametrize("case", ["panda", "panda_fingers", "solo12"])
def test_order_of_questions_does_not_matter(case: str) -> None:
    """Pinocchio's algorithms share one memory: none may spoil what another wrote."""
    robot, q, v, _ = draw(case, seed=13)
    name = robot.frame_names[-1]
    a = np.ones(robot.nv)
    questions: dict[str, Callable[[RobotState], Array]] = {
        "mass_matrix": lambda s: s.mass_matrix,
        "mass_matrix_rate": lambda s: s.mass_matrix_rate,
        "nonlinear_effects": lambda s: s.nonlinear_effects,
        "effort": lambda s: s.inverse_dynamics(a),
        "jacobian": lambda s: s.frame(name).jacobian,
        "jacobian_dot": lambda s: s.frame(name).jacobian_dot,
    }
    alone = {
        what: question(robot.state(0.0, q, v)).copy()
        for what, question in questions.items()
    }
    # One call may leave a Jacobian that another recomputes: equal up to rounding only.
    for order in itertools.permutations(questions):
        state = robot.state(0.0, q, v)
        first = {what: questions[what](state) for what in order}
        for what in order:
            for answer in (first[what], questions[what](state)):
                np.testing.assert_allclose(
                    answer, alone[what], rtol=1e-13, atol=1e-13, err_msg=what
                )


def test_a_second_frame_does_not_move_the_first() -> None:
    robot, q, v, _ = draw("panda", seed=14)
    state = robot.state(0.0, q, v)
    hand = state.frame("panda_hand")
    before = [hand.position.copy(), hand.rotation.copy(), hand.jacobian.copy()]
    state.frame("panda_link4")
    state.frame("panda_hand")
    for array, kept in zip(
        (hand.position, hand.rotation, hand.jacobian), before, strict=True
    ):
        np.testing.assert_array_equal(array, kept)


@pytest.mark.parametrize("case", ["planar3r", "panda", "panda_fingers", "solo12"])
def test_companion_states_do_not_disturb(case: str) -> None:
    """`displaced` and `ahead` are states elsewhere; the state itself stays."""
    robot, q, v, rng = draw(case, seed=15)
    name = robot.frame_names[-1]
    state = robot.state(0.5, q, v)
    before = everything(state, name)
    displacement = rng.standard_normal(robot.nv)
    companion = state.displaced(0.25, displacement)
    assert companion is not state
    assert companion.t == 0.75
    np.testing.assert_array_equal(companion.q, robot.integrate(q, displacement))
    np.testing.assert_array_equal(companion.v, v)
    there = robot.state(0.75, robot.integrate(q, displacement), v)
    assert_equal_terms(everything(companion, name), everything(there, name))

    # A companion's companion is a third state: nested differences work.
    again = companion.displaced(0.25, -displacement)
    assert again is not companion
    assert companion.t == 0.75
    np.testing.assert_array_equal(companion.q, there.q)

    ahead = state.ahead(0.01)
    assert ahead.t == 0.51
    np.testing.assert_array_equal(ahead.q, robot.integrate(q, 0.01 * v))
    np.testing.assert_array_equal(ahead.v, v)
    assert state.t == 0.5
    np.testing.assert_array_equal(state.q, q)
    # Untouched, not merely recomputable: what was handed out still reads the same.
    assert_equal_terms(everything(state, name), before)


def test_states_of_one_robot_are_apart() -> None:
    robot, q, v, rng = draw("panda", seed=16)
    first = robot.state(0.0, q, v)
    before = everything(first, "panda_hand")
    second = robot.state(1.0, robot.random_configuration(rng), 2 * v)
    everything(second, "panda_hand")
    robot.forward_dynamics(second.q, second.v, v)
    assert_equal_terms(everything(first, "panda_hand"), before)


def test_a_state_copies_what_it_is_given() -> None:
    robot, q, v, _ = draw("panda", seed=17)
    state = robot.state(0.0, q, v)
    kept = q.copy()
    q[:] = 0.0
    v[:] = 0.0
    np.testing.assert_array_equal(state.q, kept)
    assert state.v.any()


def test_arrays_outlive_the_state_that_they_came_from() -> None:
    """They are views into Pinocchio's memory, which they must keep alive."""
    robot, rng = load("panda"), np.random.default_rng(18)
    held = []
    for _ in range(50):
        q, v = robot.random_configuration(rng), rng.standard_normal(7)
        frame = robot.state(0.0, q, v).frame("panda_hand")
        M = robot.state(0.0, q, v).mass_matrix
        held.append((frame, frame.position.copy(), frame.rotation.copy(), M, M.copy()))
        gc.collect(0)
        np.full(2000, np.nan)  # would land in memory that had been freed
    for frame, position, rotation, M, M_kept in held:
        np.testing.assert_array_equal(frame.position, position)
        np.testing.assert_array_equal(frame.rotation, rotation)
        np.testing.assert_array_equal(M, M_kept)


# --- borders -------------------------------------------------------------------------


def poisoned(vector: Array, value: float, place: int = 1) -> Array:
    copied = vector.copy()
    copied[place] = value
    return copied


BAD_STATES: dict[str, tuple[Callable[[Array, Array], tuple[Any, Any, Any]], Any, str]]
BAD_STATES = {
    "NaN in q": (
        lambda q, v: (0.0, poisoned(q, np.nan), v),
        NonFiniteError,
        r"configuration q\[1\] is nan; needs finite numbers",
    ),
    "infinity in q": (
        lambda q, v: (0.0, poisoned(q, -np.inf), v),
        NonFiniteError,
        r"configuration q\[1\] is -inf; needs finite numbers",
    ),
    "NaN in v": (
        lambda q, v: (0.0, q, poisoned(v, np.nan)),
        NonFiniteError,
        r"velocity v\[1\] is nan; needs finite numbers",
    ),
    "infinities that cancel": (
        lambda q, v: (0.0, q, poisoned(poisoned(v, np.inf), -np.inf, 2)),
        NonFiniteError,
        r"velocity v\[1\] is inf; needs finite numbers",
    ),
    "NaN in t": (
        lambda q, v: (np.nan, q, v),
        NonFiniteError,
        "time t is nan; needs a finite number of seconds",
    ),
    "infinite t": (
        lambda q, v: (np.inf, q, v),
        NonFiniteError,
        "time t is inf; needs a finite number of seconds",
    ),
    "short q": (
        lambda q, v: (0.0, q[:-1], v),
        ShapeError,
        r"configuration q has shape \(18,\); solo12 needs \(19,\) "
        r"\(nq = 19, nv = 18\)",
    ),
    "q where v belongs": (
        lambda q, v: (0.0, q, q),
        ShapeError,
        r"velocity v has shape \(19,\); solo12 needs \(18,\)",
    ),
    "v where q belongs": (
        lambda q, v: (0.0, v, v),
        ShapeError,
        r"configuration q has shape \(18,\); solo12 needs \(19,\)",
    ),
    "column": (
        lambda q, v: (0.0, q[:, None], v),
        ShapeError,
        r"configuration q has shape \(19, 1\)",
    ),
    "words": (
        lambda q, v: (0.0, ["a"] * 19, v),
        ShapeError,
        "configuration q is not an array of 19 numbers",
    ),
    "nothing": (
        lambda q, v: (0.0, q, {}),
        ShapeError,
        "velocity v is not an array of 18 numbers",
    ),
    "quaternion of norm 2": (
        lambda q, v: (0.0, np.concatenate([q[:3], 2 * q[3:7], q[7:]]), v),
        ConfigurationError,
        r"q\[3:7\] = \[.*\] is a quaternion of norm 2; needs norm 1",
    ),
    "quaternion of norm 0": (
        lambda q, v: (0.0, np.concatenate([q[:3], 0 * q[3:7], q[7:]]), v),
        ConfigurationError,
        "is a quaternion of norm 0; needs norm 1",
    ),
}


# Without the compiler (NUMBA_DISABLE_JIT=1) NumPy warns of inf - inf on the way.
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.parametrize("what", BAD_STATES)
def test_bad_state_is_refused_and_leaves_the_old_one(what: str) -> None:
    robot, q, v, _ = draw("solo12", seed=19)
    spoil, error, message = BAD_STATES[what]
    state = robot.state(0.5, q, v)
    name = robot.frame_names[-1]
    before = everything(state, name)
    with pytest.raises(error, match=message) as caught:
        state.update(*spoil(q, v))
    assert isinstance(caught.value, HspControlError)
    assert isinstance(caught.value, ValueError)
    with pytest.raises(error, match=message):
        robot.state(*spoil(q, v))
    # Half a move would leave terms that disagree with q and v.
    assert state.t == 0.5
    np.testing.assert_array_equal(state.q, q)
    np.testing.assert_array_equal(state.v, v)
    assert_equal_terms(everything(state, name), before)


@pytest.mark.parametrize("norm", [0.0, 0.9, 1.0 + 2e-6, 1.1])
def test_cosine_and_sine_off_the_circle(norm: float) -> None:
    robot = load("planar3r")
    q, v = robot.neutral(), np.zeros(3)
    q[2:4] *= norm
    message = rf"q\[2:4\] = \[.*\] is a \(cos, sin\) pair of norm {norm:.6g}; needs"
    with pytest.raises(ConfigurationError, match=message):
        RobotState(robot).update(0.0, q, v)
    with pytest.raises(ConfigurationError, match=message):
        robot.check_configuration(q)


def test_rounding_off_the_circle_passes() -> None:
    """Integrators drift by rounding; 1e-7 is no error, and is kept as given."""
    robot = load("planar3r")
    q = robot.neutral()
    q[2:4] *= 1.0 + 1e-7
    np.testing.assert_array_equal(RobotState(robot).update(0.0, q, np.zeros(3)).q, q)


@pytest.mark.parametrize(
    "convert",
    [
        list,
        tuple,
        lambda x: np.asfortranarray(np.vstack([x, x]).T)[:, 0],
        lambda x: np.vstack([x, x]).T[:, 1],  # not contiguous
        lambda x: np.repeat(x, 2)[::2],
    ],
)
def test_any_sequence_of_numbers_will_do(convert: Callable[[Array], Any]) -> None:
    robot, q, v, _ = draw("solo12", seed=20)
    name = robot.frame_names[-1]
    expected = everything(robot.state(0.1, q, v), name)
    state = RobotState(robot).update(0.1, convert(q), convert(v))
    assert_equal_terms(everything(state, name), expected)
    state = robot.state(0.1, convert(q), convert(v))
    assert_equal_terms(everything(state, name), expected)


@pytest.mark.parametrize("kind", [int, np.float32])
def test_other_kinds_of_numbers_will_do(kind: type) -> None:
    robot = load("panda")
    q, v = np.arange(7, dtype=kind), np.ones(7, dtype=kind)
    expected = robot.state(0.0, q.astype(float), v.astype(float))
    actual = RobotState(robot).update(0, q, v)
    assert actual.q.dtype == np.float64
    assert_equal_terms(
        everything(actual, "panda_hand"), everything(expected, "panda_hand")
    )


def test_a_frame_that_can_only_be_read_is_no_obstacle() -> None:
    robot, q, v, _ = draw("panda", seed=21)
    q.setflags(write=False)
    v.setflags(write=False)
    np.testing.assert_array_equal(RobotState(robot).update(0.0, q, v).q, q)


# --- names ---------------------------------------------------------------------------


def test_unknown_frame() -> None:
    robot, q, v, _ = draw("panda", seed=22)
    message = (
        "no frame 'panda_hnad'; did you mean 'panda_hand'? (the model has universe"
    )
    for ask in (robot.frame_id, robot.state(0.0, q, v).frame):
        with pytest.raises(FrameNotFoundError, match=re.escape(message)) as caught:
            ask("panda_hnad")
        assert isinstance(caught.value, LookupError)
    with pytest.raises(FrameNotFoundError, match="did you mean 'panda_hand'"):
        robot.frame_id("hand")


@pytest.mark.parametrize(
    ("joint", "hint"),
    [
        ("panda_joint8", "; did you mean 'panda_joint"),
        ("panda_finger_joint1", "; did you mean 'panda_joint"),  # locked
        ("universe", " (the model has panda_joint1, "),  # Pinocchio's, not a joint
        ("panda_hand", " (the model has panda_joint1, "),  # a frame
    ],
)
def test_unknown_joint(joint: str, hint: str) -> None:
    with pytest.raises(JointNotFoundError, match=re.escape(f"no joint {joint!r}")) as e:
        load("panda").velocity_index(joint)
    assert hint in str(e.value)
    assert isinstance(e.value, LookupError)


def test_names_of_joints_and_freedoms() -> None:
    """One name a freedom, in the order of velocities; the universe is no joint."""
    assert load("planar3r").joint_names == ("joint1", "joint2", "joint3")
    assert load("planar3r").dof_names == ("joint1", "joint2", "joint3")
    fingers = load("panda_fingers")  # the follower has no freedom
    assert fingers.joint_names[-2:] == ("panda_joint7", "panda_finger_joint1")
    assert len(fingers.dof_names) == fingers.nv == 8

    solo = load("solo12")
    assert solo.joint_names[:2] == ("root_joint", "FL_HAA")
    assert solo.dof_names[:7] == (
        *(f"root_joint.{axis}" for axis in ("x", "y", "z", "roll", "pitch", "yaw")),
        "FL_HAA",
    )
    assert len(solo.dof_names) == solo.nv
    assert solo.velocity_index("root_joint") == slice(0, 6)
    assert solo.velocity_index("FL_HAA") == slice(6, 7)

    planar = load("talos_arm_planar")
    assert planar.dof_names[:3] == (
        "root_joint.x",
        "root_joint.y",
        "root_joint.yaw",
    )
    assert planar.velocity_index("root_joint") == slice(0, 3)


def test_repr() -> None:
    assert repr(load("planar3r")) == "Robot('planar3r', nq=6, nv=3)"


# --- configuration space -------------------------------------------------------------


def hand_built(*joints: Any) -> Robot:
    """Return a chain of the given joints, each with a body of mass."""
    model, parent = pin.Model(), 0
    for number, joint in enumerate(joints):
        placement = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
        parent = model.addJoint(parent, joint, placement, f"j{number}")
        inertia = pin.Inertia.FromSphere(1.0, 0.1)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return Robot(model, RobotSource("hand_built", Path("nowhere.urdf")))


def test_unit_blocks() -> None:
    """Where quaternions and (cos, sin) pairs lie in q."""
    robot = hand_built(
        pin.JointModelFreeFlyer(),  # x y z, quaternion
        pin.JointModelRX(),
        pin.JointModelRUBZ(),  # (cos, sin)
        pin.JointModelPlanar(),  # x y, (cos, sin)
        pin.JointModelSpherical(),  # quaternion
        pin.JointModelPY(),
        pin.JointModelRUBX(),
    )
    assert robot.nq == 7 + 1 + 2 + 4 + 4 + 1 + 2
    assert robot.unit_blocks == ((3, 4), (8, 2), (12, 2), (14, 4), (19, 2))
    assert not robot.flat
    # Every block is one that Pinocchio normalises, and nothing else is.
    q = np.full(robot.nq, 3.0)
    normalised = pin.normalize(robot.model, q)
    changed = np.zeros(robot.nq, dtype=bool)
    for start, size in robot.unit_blocks:
        changed[start : start + size] = True
    np.testing.assert_array_equal(normalised != q, changed)
    robot.check_configuration(normalised)
    for start, size in robot.unit_blocks:
        spoilt = normalised.copy()
        spoilt[start : start + size] *= 1.5
        kind = "quaternion" if size == 4 else "(cos, sin) pair"
        with pytest.raises(
            ConfigurationError, match=re.escape(f"is a {kind} of norm 1.5")
        ):
            robot.state(0.0, spoilt, np.zeros(robot.nv))
    # Joints added in Python have no limits unless they are given some.
    lower, upper = robot.position_limits()
    np.testing.assert_array_equal(lower, np.full(robot.nv, -np.inf))
    np.testing.assert_array_equal(upper, np.full(robot.nv, np.inf))
    rng = np.random.default_rng(0)
    robot.check_configuration(robot.random_configuration(rng))
    np.testing.assert_array_equal(robot.home(), robot.neutral())


@pytest.mark.parametrize(
    ("case", "blocks", "flat", "mimics"),
    [
        ("planar3r", ((0, 2), (2, 2), (4, 2)), True, False),
        ("panda", (), True, False),
        ("panda_fingers", (), True, True),
        ("solo12", ((3, 4),), False, False),
        ("talos_arm_planar", ((2, 2),), False, False),
    ],
)
def test_kind_of_configuration_space(
    case: str, blocks: tuple[tuple[int, int], ...], flat: bool, mimics: bool
) -> None:
    robot = load(case)
    assert robot.unit_blocks == blocks
    assert robot.flat is flat
    assert robot.mimics is mimics


@pytest.mark.parametrize("case", ROBOTS)
def test_integrate_and_difference_undo_each_other(case: str) -> None:
    robot, q, v, _ = draw(case, seed=23)
    moved = robot.integrate(q, 0.5 * v)
    robot.check_configuration(moved)
    np.testing.assert_allclose(robot.difference(q, moved), 0.5 * v, rtol=0, atol=1e-13)


@pytest.mark.parametrize("case", ["planar3r", "tiago", "tiago_pro", "solo12"])
def test_joint_positions(case: str) -> None:
    """The log from neutral; continuous joints as angles in (-π, π]."""
    robot, rng = load(case), np.random.default_rng(24)
    single = [j for j in robot.joints.values() if j.nv == 1]
    angles = np.zeros(robot.nv)
    for joint in single:
        angles[joint.idx_v] = rng.uniform(-3.1, 3.1)
    q = robot.integrate(robot.neutral(), angles)
    np.testing.assert_allclose(robot.joint_positions(q), angles, rtol=0, atol=1e-14)

    turned = angles.copy()
    for joint in single:
        if joint.nq == 2:  # winds twice: the angle comes back
            turned[joint.idx_v] += 4.0 * np.pi
    q = robot.integrate(robot.neutral(), turned)
    # 1e-14 of the sine and cosine of up to 16 rad.
    np.testing.assert_allclose(robot.joint_positions(q), angles, rtol=0, atol=1e-14)


def test_half_a_turn_is_pi_and_not_minus_pi() -> None:
    robot = load("planar3r")
    q = np.array([-1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(robot.joint_positions(q), [np.pi, 0.0, np.pi / 2])


@pytest.mark.parametrize("case", ROBOTS)
def test_position_limits(case: str) -> None:
    """The model's for joints with one number; none for continuous joints and roots."""
    robot = load(case)
    lower, upper = robot.position_limits()
    for name, joint in robot.joints.items():
        where = slice(joint.idx_v, joint.idx_v + joint.nv)
        if joint.nq == 1:
            urdf = ElementTree.parse(robot.source.urdf).find(f"joint[@name='{name}']")
            assert urdf is not None
            limit = urdf.find("limit")
            assert limit is not None
            assert lower[where] == float(limit.attrib["lower"])
            assert upper[where] == float(limit.attrib["upper"])
        else:
            assert (lower[where] == -np.inf).all(), name
            assert (upper[where] == np.inf).all(), name


def test_planar_arm_has_no_limits() -> None:
    """The last joint, too: Pinocchio's universe claims its place in the tables."""
    lower, upper = load("planar3r").position_limits()
    np.testing.assert_array_equal(lower, [-np.inf] * 3)
    np.testing.assert_array_equal(upper, [np.inf] * 3)


def test_home_is_the_sources_or_neutral_or_the_middle_of_the_range() -> None:
    panda = load("panda")
    np.testing.assert_array_equal(panda.home(), panda.source.home)
    # One joint locked: the recommended posture no longer fits, so limits decide. The
    # fourth joint's range, -3.0718 to -0.0698, does not contain 0; the sixth's, -0.0175
    # to 3.7525, does, if barely.
    locks = {"panda_joint1": 0.0, "panda_finger_joint1": 0.0}
    shorter = Robot.load("panda", locked=locks)
    middle = (-3.0718 - 0.0698) / 2
    np.testing.assert_allclose(
        shorter.home(), [0, 0, middle, 0, 0, 0], rtol=0, atol=1e-15
    )
    lower, upper = shorter.position_limits()
    assert ((lower <= shorter.home()) & (shorter.home() <= upper)).all()
    # Continuous joints: home is given as angles.
    np.testing.assert_allclose(
        load("planar3r").joint_positions(load("planar3r").home()),
        np.deg2rad([30, 60, 60]),
        rtol=0,
        atol=1e-15,
    )
    # Who may fall starts as the SRDF has it stand.
    np.testing.assert_allclose(load("solo12").home()[:7], [0, 0, 0.235, 0, 0, 0, 1])
    np.testing.assert_allclose(load("solo12").home()[7:10], [0.1, 0.8, -1.6])


@pytest.mark.parametrize("name", sorted({*BUNDLED, *example_robots()} - set(REFUSED)))
def test_random_and_home_configurations_are_within_limits(name: str) -> None:
    """For every robot that there is, with a floating root and without."""
    robot = Robot.load(name)
    lower, upper = robot.position_limits()
    rng = np.random.default_rng(25)
    drawn = [robot.random_configuration(rng) for _ in range(5)]
    for q in (robot.home(), robot.neutral(), *drawn):
        robot.check_configuration(q)
    for q in (robot.home(), *drawn):
        positions = robot.joint_positions(q)
        assert (positions >= lower - 1e-12).all()
        assert (positions <= upper + 1e-12).all()
    # They differ, unless the URDF's limits are 0 and 0 (the double pendulums').
    if (upper > lower).any():
        assert np.abs(robot.difference(drawn[0], drawn[1])).max() > 0.0
    # The generator decides: the same seed draws the same.
    again = robot.random_configuration(np.random.default_rng(25))
    np.testing.assert_array_equal(again, drawn[0])


def test_random_configurations_fill_the_space() -> None:
    """Continuous joints go all the way round, limited ones from end to end."""
    rng = np.random.default_rng(26)
    for case in ("planar3r", "panda"):
        robot = load(case)
        lower, upper = robot.position_limits()
        low = np.where(np.isfinite(lower), lower, -np.pi)
        high = np.where(np.isfinite(upper), upper, np.pi)
        drawn = [robot.random_configuration(rng) for _ in range(400)]
        positions = np.array([robot.joint_positions(q) for q in drawn])
        # Of 400 uniform draws none in a given twentieth at an end: 0.95^400 = 1e-9.
        assert (positions.min(axis=0) < low + 0.05 * (high - low)).all()
        assert (positions.max(axis=0) > high - 0.05 * (high - low)).all()


def test_floating_root_is_drawn_in_a_unit_box_any_way_up() -> None:
    robot, rng = load("solo12"), np.random.default_rng(27)
    drawn = np.array([robot.random_configuration(rng)[:7] for _ in range(400)])
    assert np.abs(drawn[:, :3]).max() <= 1.0
    assert drawn[:, :3].min() < -0.9
    assert drawn[:, :3].max() > 0.9
    # Uniform on SO(3): E[R] = 0; the mean of 400 entries of R has deviation 0.03.
    mean = np.mean([pin.Quaternion(q).matrix() for q in drawn[:, 3:]], axis=0)
    assert np.abs(mean).max() < 0.15


def test_neutral_is_every_joint_at_zero() -> None:
    for case in ROBOTS:
        robot = load(case)
        neutral = robot.neutral()
        robot.check_configuration(neutral)
        assert not robot.joint_positions(neutral).any()


# --- persistence ---------------------------------------------------------------------


def by_pickle(robot: Robot) -> Robot:
    return pickle.loads(pickle.dumps(robot))


@pytest.mark.parametrize("case", ROBOTS)
@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_pickle_and_deep_copy_round_trip(
    case: str, duplicate: Callable[[Robot], Robot]
) -> None:
    """The other robot is another object that says the same, to the last bit."""
    robot, q, v, _ = draw(case, seed=28)
    if robot.mimics and duplicate is by_pickle:
        # Pinocchio would restore a model that ends the process when it is used.
        with pytest.raises(
            ModelError, match=r"mimic joints cannot be pickled; .*False"
        ):
            pickle.dumps(robot)
        return
    other = duplicate(robot)
    assert other is not robot
    assert other.model is not robot.model
    assert other.source == robot.source
    assert repr(other) == repr(robot)
    for name in ("joint_names", "dof_names", "frame_names", "unit_blocks"):
        assert getattr(other, name) == getattr(robot, name)
    np.testing.assert_array_equal(other.home(), robot.home())
    frame = robot.frame_names[-1]
    assert_equal_terms(
        everything(other.state(0.0, q, v), frame),
        everything(robot.state(0.0, q, v), frame),
    )
    np.testing.assert_array_equal(
        other.forward_dynamics(q, v, v), robot.forward_dynamics(q, v, v)
    )


def test_joint_coordinates() -> None:
    """θ = A q: the planar arm's absolute angles; none for other robots."""
    A = load("planar3r").joint_coordinates
    assert A is not None
    np.testing.assert_array_equal(A @ [1.0, 2.0, 4.0], [1.0, 3.0, 7.0])
    assert load("panda").joint_coordinates is None


def test_robot_of_a_given_model() -> None:
    """`Robot.load` adds nothing to the constructor."""
    source = find_robot("panda")
    robot, loaded = Robot(load_model(source), source), load("panda")
    assert robot.model == loaded.model
    assert robot.source == loaded.source


# --- several robots as one -----------------------------------------------------------


def pair() -> tuple[Robot, dict[str, tuple[Robot, pin.SE3]]]:
    """Return an arm, the planar arm upside down and a walking one, as one robot."""
    up = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.2, 0.3), np.array([1.0, 2.0, 0.5]))
    own = {
        "left": (load("panda"), pin.SE3.Identity()),
        "flat": (load("planar3r"), up),
        "dog": (load("solo12"), pin.SE3.Identity()),
    }
    return Robot.combine(own), own


def test_combined_robots_do_not_mix() -> None:
    """Each part moves, weighs and is limited as if alone, where it was put."""
    both, own = pair()
    assert (both.nq, both.nv) == (7 + 6 + 19, 7 + 3 + 18)
    rng = np.random.default_rng(29)
    q = both.random_configuration(rng)
    v, a = rng.standard_normal((2, both.nv))
    state = both.state(0.0, q, v)
    M, M_dot = state.mass_matrix.copy(), state.mass_matrix_rate.copy()
    tau = state.inverse_dynamics(a)
    lower, upper = both.position_limits()
    home = both.joint_positions(both.home())
    start_q = start_v = 0
    for name, (robot, place) in own.items():
        of_q = slice(start_q, start_q + robot.nq)
        of_v = slice(start_v, start_v + robot.nv)
        start_q, start_v = of_q.stop, of_v.stop
        # Gravity as the part feels it, which may hang from the ceiling.
        turned = copy.deepcopy(robot)
        turned.model.gravity.linear = place.rotation.T @ robot.model.gravity.linear
        alone = turned.state(0.0, q[of_q], v[of_v])
        for actual, expected in (
            (M[of_v, of_v], alone.mass_matrix),
            (M_dot[of_v, of_v], alone.mass_matrix_rate),
            (tau[of_v], alone.inverse_dynamics(a[of_v])),
            (lower[of_v], robot.position_limits()[0]),
            (upper[of_v], robot.position_limits()[1]),
            (home[of_v], robot.joint_positions(robot.home())),
        ):
            np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)
        M[of_v, of_v] = 0.0
        assert [f"{name}_{joint}" for joint in robot.joint_names] == [
            joint for joint in both.joint_names if joint.startswith(f"{name}_")
        ]
        # The last frame: moved to where the part stands, by its own joints alone.
        frame, mine = robot.frame_names[-1], alone.frame(robot.frame_names[-1])
        there = state.frame(f"{name}_{frame}")
        np.testing.assert_allclose(there.position, place.act(mine.position), atol=1e-14)
        R = np.kron(np.eye(2), place.rotation)
        for what in ("jacobian", "jacobian_dot"):
            moved = getattr(there, what).copy()
            np.testing.assert_allclose(
                moved[:, of_v], R @ getattr(mine, what), rtol=0, atol=1e-12
            )
            moved[:, of_v] = 0.0
            assert not moved.any()
    assert not M.any()  # nothing outside the blocks


@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_combined_robot_round_trip(duplicate: Callable[[Robot], Robot]) -> None:
    both, own = pair()
    other = duplicate(both)
    assert other.joint_names == both.joint_names
    assert [part.prefix for part in other.parts] == [f"{name}_" for name in own]
    assert [part.source for part in other.parts] == [r.source for r, _ in own.values()]
    np.testing.assert_array_equal(other.home(), both.home())
    assert load("panda").parts[0].source == load("panda").source


def test_robots_that_cannot_be_combined() -> None:
    here = pin.SE3.Identity()
    with pytest.raises(ModelError, match="robots to combine need different names"):
        Robot.combine({"only": (load("panda"), here)})
    with pytest.raises(ModelError, match="joints that mimic others cannot be combined"):
        Robot.combine({"a": (load("panda"), here), "b": (load("panda_fingers"), here)})


def test_gravity_of_combined_robots_is_their_own() -> None:
    here = pin.SE3.Identity()
    weightless = {
        name: (Robot.load(robot, gravity=(0.0, 0.0, 0.0)), here)
        for name, robot in (("a", "panda"), ("b", "iiwa14"))
    }
    both = Robot.combine(weightless)
    state = both.state(0.0, both.home(), np.zeros(both.nv))
    np.testing.assert_allclose(state.nonlinear_effects, 0.0, rtol=0, atol=1e-12)
    with pytest.raises(ModelError, match="differ in gravity"):
        Robot.combine({**weightless, "c": (load("iiwa14"), here)})


def test_equal_limits_mean_none() -> None:
    """A URDF that leaves limits out gives 0 to 0 (double_pendulum)."""
    robot = Robot.load("double_pendulum")
    assert np.isinf(robot.position_limits()).all()
    assert robot.random_configuration(np.random.default_rng(0)).all()


def test_lists_will_do_for_integrate_and_difference() -> None:
    robot = load("panda")
    home, step = robot.home(), [0.1, 0, 0, 0, 0, 0, -0.2]
    moved = robot.integrate(list(home), step)
    np.testing.assert_array_equal(moved, robot.integrate(home, np.array(step)))
    np.testing.assert_array_equal(
        robot.difference(home.tolist(), moved.tolist()), robot.difference(home, moved)
    )


@pytest.mark.parametrize("wrong", [[0.1], np.zeros(8), "left", None])
def test_integrate_and_difference_say_what_does_not_fit(wrong: object) -> None:
    robot = load("panda")
    with pytest.raises(ShapeError, match=r"^displacement (has shape|is not an array)"):
        robot.integrate(robot.home(), wrong)
    with pytest.raises(ShapeError, match=r"^configuration q "):
        robot.integrate(wrong, np.zeros(7))
    with pytest.raises(ShapeError, match=r"^configuration q "):
        robot.difference(robot.home(), wrong)
