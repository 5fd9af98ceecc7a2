"""A spring with bounded force: it slips, and generates no energy."""

from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from places import further
from spring_energy import spring_energy
from task_cases import placed

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.slipping import slipped, spring_force

MOST = 30.0, 2.0  # of the position and of the orientation [N, N·m]
PARTS = (
    ErrorPart("position", "m", "m/s", 3),
    ErrorPart("orientation", "rad", "rad/s", 3),
)
ENDS = np.array([3, 6])


def springs(kind: str, rng: np.random.Generator) -> Array:
    """Return the matrices of a random impedance of a pose."""
    each = np.exp(rng.uniform(np.log(10.0), np.log(2000.0), 6))
    stiffness: Any = each.tolist()
    if kind == "led":  # without stiffness along two directions, not aligned with rows
        each[:2] = 0.0
    if kind != "diagonal":
        turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        stiffness = (turn * each) @ turn.T
        stiffness = (0.5 * (stiffness + stiffness.T)).tolist()
    return hsp.Impedance(stiffness, largest_force=list(MOST)).numbers(PARTS)


kinds = pytest.mark.parametrize("kind", ["diagonal", "coupled", "led"])


@kinds
@pytest.mark.parametrize("seed", range(20))
def test_the_force_is_the_gradient_of_a_convex_energy(kind: str, seed: int) -> None:
    """By differences; and (s(a) - s(b))ᵀ(a - b) >= 0, so that it is convex."""
    rng = np.random.default_rng(seed)
    numbers = springs(kind, rng)
    a, b = 10.0 ** rng.uniform(-3.0, 0.5, (2, 1)) * rng.normal(size=(2, 6))
    force = spring_force(numbers, ENDS, a)
    step = 1e-6 * float(np.linalg.norm(a))
    slope = [
        (
            spring_energy(numbers, ENDS, a + step * way)
            - spring_energy(numbers, ENDS, a - step * way)
        )
        / (2.0 * step)
        for way in np.eye(6)
    ]
    scale = np.abs(force).max()
    np.testing.assert_allclose(slope, force, rtol=0, atol=1e-5 * scale)
    assert (force - spring_force(numbers, ENDS, b)) @ (a - b) >= 0.0
    assert np.linalg.norm(force[:3]) <= MOST[0] * (1.0 + 1e-9)
    assert np.linalg.norm(force[3:]) <= MOST[1] * (1.0 + 1e-9)
    # No force along a direction without stiffness, at any displacement.
    K = parts_of(numbers).K
    values, axes = np.linalg.eigh(K)
    assert np.abs(axes[:, values < 1e-9].T @ force).max(initial=0.0) < 1e-7 * scale


@pytest.mark.parametrize("kind", ["diagonal", "coupled"])
@pytest.mark.parametrize("seed", range(20))
def test_no_part_pulls_with_more_and_slips_only_there(kind: str, seed: int) -> None:
    """The slip e - K⁻¹s of a part is along its force, and zero below its bound."""
    rng = np.random.default_rng(100 + seed)
    numbers = springs(kind, rng)
    K = parts_of(numbers)[0]
    e = 10.0 ** rng.uniform(-3.0, 0.5) * rng.normal(size=6)
    force = spring_force(numbers, ENDS, e)
    slip = e - np.linalg.solve(K, force)
    for rows, most in zip((slice(0, 3), slice(3, 6)), MOST, strict=True):
        size = float(np.linalg.norm(force[rows]))
        assert size <= most * (1.0 + 1e-9)
        along = float(slip[rows] @ force[rows])
        assert along >= -1e-9 * size * float(np.linalg.norm(e))
        off = along - size * np.linalg.norm(slip[rows])
        assert abs(off) < 1e-9 * size * float(np.linalg.norm(e))
        if size < most * (1.0 - 1e-9):
            np.testing.assert_allclose(slip[rows], 0.0, atol=1e-10)
    inside = all(np.linalg.norm((K @ e)[a:b]) <= f for a, b, f in
                 zip((0, 3), (3, 6), MOST, strict=True))  # fmt: skip
    if inside:
        np.testing.assert_array_equal(force, K @ e)
        assert slipped(numbers, ENDS, e) == 0.0


def test_the_default_of_a_robot() -> None:
    """Force: the strongest motor's effort at a lever of half the robot's size. Moment:
    half of that effort."""
    robot = panda()
    task = placed(hsp.FramePose("panda_tcp", impedance=hsp.Impedance(100.0)), robot)
    strongest = 87.0
    own = (strongest / (0.5 * robot.size), 0.5 * strongest)
    assert task.impedance is not None
    assert task.impedance.largest_force == own
    assert placed(task, robot).impedance == task.impedance
    numbers = task.impedance.numbers(task.error_parts)
    np.testing.assert_allclose(parts_of(numbers)[3], 1.0 / np.repeat(own, 3))
    without = hsp.Impedance(100.0, largest_force="none")
    task = placed(hsp.FramePose("panda_tcp", impedance=without), robot)
    assert task.impedance is not None
    assert not parts_of(task.impedance.numbers(task.error_parts))[3].any()
    joints = placed(hsp.JointPosture("home", impedance=hsp.Impedance(100.0)), robot)
    assert joints.impedance is not None
    assert joints.impedance.largest_force == (None,)
    with pytest.raises(GainError, match=r"largest_force: has 3 numbers; needs one for"):
        placed(
            hsp.FramePose(
                "panda_tcp", impedance=hsp.Impedance(1.0, largest_force=[1.0] * 3)
            ),
            robot,
        )


@pytest.mark.parametrize("force", [20.0, *further(5.0)])
def test_its_energy_falls(force: float) -> None:
    """E = ½ e'ᵀΛe' + U(e) decreases by the dissipation; within the bound nothing
    changes."""
    robot = panda()
    q0 = robot.home()
    here = robot.state(0.0, q0, np.zeros(7)).position("panda_tcp").copy()
    target = hsp.Hold(here + np.array([-0.1, 0.2, -0.1]))
    spring = hsp.Impedance([300.0, 600.0, 200.0], damping=40.0, largest_force=force)
    hand = hsp.FramePosition("panda_tcp", target, impedance=spring, name="hand")
    controller = hsp.Controller(robot, [hand], limits=None)
    run = hsp.simulate(
        controller, q0, duration=1.0, log_period=2e-3,
        integrator=hsp.integrators.Rk4(2e-3),
    )  # fmt: skip
    numbers = spring.numbers(controller.tasks[0].error_parts)
    numbers[-1] = 1.0 / force
    assert run["task.hand.bounded"][0] == pytest.approx(np.sqrt(0.06))
    energy, power = [], []
    e, rate = run["task.hand.error"], run["task.hand.error_rate"]
    for row, q in enumerate(run.q):
        state = robot.state(0.0, q, run.v[row])
        J = state.frame("panda_tcp").jacobian[:3]
        inertia = np.linalg.inv(J @ np.linalg.solve(state.mass_matrix, J.T))
        potential = spring_energy(numbers, np.array([3]), e[row])
        energy.append(0.5 * rate[row] @ inertia @ rate[row] + potential)
        power.append(40.0 * rate[row] @ rate[row])
        assert np.linalg.norm(spring_force(numbers, np.array([3]), e[row])) <= (
            force * (1.0 + 1e-10)
        )
    assert not run["damped"].any()
    assert (np.diff(energy) <= 1e-12).all()
    lost = 2e-3 * 0.5 * (np.array(power)[1:] + np.array(power)[:-1])
    assert energy[0] - energy[-1] == pytest.approx(lost.sum(), rel=1e-4)
