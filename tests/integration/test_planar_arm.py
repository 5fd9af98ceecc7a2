"""The hand-written planar arm against first principles and against the paper."""

from collections.abc import Callable

import numpy as np
import planar_arm as arm
import pytest
from numpy.testing import assert_allclose
from planar_arm import Array, simulate_paper

SIMULATIONS = (1, 2, 3, 4)
PERTURBATION = 1e-9  # of the first angle at the start [rad]


@pytest.fixture(params=range(5))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def random_state(rng: np.random.Generator) -> tuple[float, Array, Array]:
    """Return t, θ, θ' away from singularities, where J⁺ has no useful derivative."""
    while True:
        theta = rng.uniform(-np.pi, np.pi, 3)
        if arm.gram_determinant(arm.jacobian(theta)) > 0.3:
            return rng.uniform(0.0, 10.0), theta, rng.normal(size=3)


def derivative(f: Callable[[float], Array], h: float = 1e-3) -> Array:
    """Return f'(0) by five points: truncation of order h⁴, rounding of 1e-16/h."""
    near, far = f(h) - f(-h), f(2.0 * h) - f(-2.0 * h)
    return (8.0 * near - far) / (12.0 * h)


def kinetic_energy(theta: Array, theta_dot: Array) -> float:
    """Return ½ Σ |p_k'|² over the unit masses, p_k' by a complex step: to rounding."""
    step = 1e-30
    p_dot = arm.joint_positions(theta + 1j * step * theta_dot).imag / step
    return 0.5 * float((p_dot**2).sum())


def momentum(theta: Array, theta_dot: Array) -> Array:
    """Return ∂T/∂θ'; T is quadratic in θ', so a central difference is exact."""
    return np.array(
        [
            kinetic_energy(theta, theta_dot + unit / 2)
            - kinetic_energy(theta, theta_dot - unit / 2)
            for unit in np.eye(3)
        ]
    )


# --- kinematics and dynamics ---------------------------------------------------------


def test_jacobian_is_the_derivative_of_the_position(rng: np.random.Generator) -> None:
    _, theta, theta_dot = random_state(rng)
    step = 1e-30
    x_dot = arm.forward_kinematics(theta + 1j * step * theta_dot).imag / step
    assert_allclose(arm.jacobian(theta) @ theta_dot, x_dot, atol=1e-14)


def test_jacobian_rate_is_the_derivative_of_the_jacobian(
    rng: np.random.Generator,
) -> None:
    _, theta, v = random_state(rng)
    expected = derivative(lambda s: arm.jacobian(theta + s * v))
    assert_allclose(arm.jacobian_rate(theta, v), expected, atol=1e-11)


def test_pseudo_inverse_is_the_svd_one(rng: np.random.Generator) -> None:
    J = arm.jacobian(random_state(rng)[1])
    assert_allclose(arm.pseudo_inverse(J), np.linalg.pinv(J), atol=1e-13)
    assert arm.gram_determinant(J) == pytest.approx(np.linalg.det(J @ J.T), abs=1e-14)


def test_pseudo_inverse_rate_is_its_derivative(rng: np.random.Generator) -> None:
    _, theta, v = random_state(rng)
    J, J_dot = arm.jacobian(theta), arm.jacobian_rate(theta, v)
    expected = derivative(lambda s: arm.pseudo_inverse(arm.jacobian(theta + s * v)))
    assert_allclose(arm.pseudo_inverse_rate(J, J_dot), expected, atol=1e-9)


def test_mass_matrix_is_that_of_the_kinetic_energy(rng: np.random.Generator) -> None:
    _, theta, _ = random_state(rng)
    expected = np.array([momentum(theta, unit) for unit in np.eye(3)])
    assert_allclose(arm.mass_matrix(theta), expected, atol=1e-13)


def test_nonlinear_effects_are_those_of_lagrange(rng: np.random.Generator) -> None:
    """N = (∂T/∂θ')' - ∂T/∂θ where θ'' = 0."""
    _, theta, v = random_state(rng)
    momentum_rate = derivative(lambda s: momentum(theta + s * v, v))
    slope = np.array(
        [
            derivative(lambda s, unit=unit: kinetic_energy(theta + s * unit, v))
            for unit in np.eye(3)
        ]
    )
    expected = momentum_rate - slope
    assert_allclose(arm.nonlinear_effects(theta, v), expected, atol=1e-10)


def test_circle_and_disk_move_at_their_rates() -> None:
    t = 0.7
    x_d, x_d_dot, x_d_ddot = arm.circle(t)
    assert np.hypot(*(x_d - 1.0)) == pytest.approx(1.0)
    assert_allclose(x_d_dot, derivative(lambda s: arm.circle(t + s)[0]), atol=1e-10)
    assert_allclose(x_d_ddot, derivative(lambda s: arm.circle(t + s)[1]), atol=1e-9)
    c_dot = derivative(lambda s: arm.disk_center(t + s)[0])
    assert_allclose(arm.disk_center(t)[1], c_dot, atol=1e-10)


@pytest.mark.parametrize("number", SIMULATIONS)
def test_gradient_is_the_derivative_of_the_cost(
    number: int, rng: np.random.Generator
) -> None:
    t, theta, _ = random_state(rng)
    expected = np.array(
        [
            derivative(lambda s, unit=unit: arm.cost(number, t, theta + s * unit))
            for unit in np.eye(3)
        ]
    )
    gradient = arm.cost_gradient(number, t, theta)
    assert_allclose(gradient, expected, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("number", SIMULATIONS)
def test_gradient_rate_is_total(number: int, rng: np.random.Generator) -> None:
    t, theta, v = random_state(rng)
    expected = derivative(lambda s: arm.cost_gradient(number, t + s, theta + s * v))
    rate = arm.cost_gradient_rate(number, t, theta, v)
    assert_allclose(rate, expected, rtol=1e-8, atol=1e-8)


# --- the law at one state ------------------------------------------------------------


@pytest.mark.parametrize("number", SIMULATIONS)
def test_torque_produces_the_commanded_acceleration(
    number: int, rng: np.random.Generator
) -> None:
    t, theta, v = random_state(rng)
    law = arm.paper_law(number, t, theta, v)
    acceleration = arm.forward_dynamics(theta, v, law.tau)
    assert_allclose(acceleration, law.acceleration, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("number", SIMULATIONS)
def test_task_error_equation_is_linear(number: int, rng: np.random.Generator) -> None:
    """e'' + K_v e' + K_p e = 0, Proposition 1, for J φ_N = 0."""
    t, theta, v = random_state(rng)
    law = arm.paper_law(number, t, theta, v)
    J, J_dot = arm.jacobian(theta), arm.jacobian_rate(theta, v)
    assert_allclose(J @ law.null_space_acceleration, 0.0, atol=1e-11)
    e_ddot = arm.circle(t)[2] - J @ law.acceleration - J_dot @ v
    residual = e_ddot + 20.0 * law.task_error_rate + 100.0 * law.task_error
    assert_allclose(residual, 0.0, atol=1e-10)


@pytest.mark.parametrize("number", [2, 3, 4])
def test_null_space_error_decays(number: int, rng: np.random.Generator) -> None:
    """(I - J⁺J) e_N' = -K_N e_N, which is V' = -K_N e_Nᵀe_N in every direction.

    e_N' by differences along the motion that the law commands: nothing of eq. (13)'s
    derivation is used.
    """
    t, theta, v = random_state(rng)
    law = arm.paper_law(number, t, theta, v)

    def null_space_error(s: float) -> Array:
        at = theta + s * v + s**2 / 2.0 * law.acceleration
        at_rate = v + s * law.acceleration
        return arm.paper_law(number, t + s, at, at_rate).null_space_error

    J = arm.jacobian(theta)
    P = np.eye(3) - np.linalg.pinv(J) @ J
    e_N_dot = derivative(null_space_error, h=1e-4)
    expected = -10.0 * law.null_space_error
    scale = 1.0 + np.abs(e_N_dot).max()
    assert_allclose(P @ e_N_dot, expected, rtol=0.0, atol=1e-8 * scale)


def test_short_form_of_the_correction(rng: np.random.Generator) -> None:
    """J⁺J'J⁺ + (J⁺)' = (I - J⁺J) J'ᵀ(JJᵀ)⁻¹, on which the package's law rests."""
    _, theta, v = random_state(rng)
    J, J_dot = arm.jacobian(theta), arm.jacobian_rate(theta, v)
    J_plus = arm.pseudo_inverse(J)
    printed = J_plus @ J_dot @ J_plus + arm.pseudo_inverse_rate(J, J_dot)
    short = (np.eye(3) - J_plus @ J) @ J_dot.T @ np.linalg.inv(J @ J.T)
    assert_allclose(printed, short, atol=1e-12)


def test_paper_has_four_simulations() -> None:
    with pytest.raises(ValueError, match="simulations 1 to 4, not 5"):
        arm.paper_law(5, 0.0, np.zeros(3), np.zeros(3))


# --- absolute and relative angles ----------------------------------------------------


def test_relative_angles_turn_each_link_against_the_last() -> None:
    theta = np.array([0.3, 1.0, -0.5])
    assert_allclose(arm.relative_from_absolute(theta), [0.3, 0.7, -1.5])


def test_conversions_invert_each_other_and_keep_the_power(
    rng: np.random.Generator,
) -> None:
    theta_dot, tau = rng.normal(size=(2, 7, 3))
    q_dot, tau_q = arm.relative_from_absolute(theta_dot), arm.relative_torque(tau)
    assert_allclose(arm.absolute_from_relative(q_dot), theta_dot, atol=1e-14)
    assert_allclose(arm.absolute_torque(tau_q), tau, atol=1e-14)
    power = (tau * theta_dot).sum(axis=1)
    assert_allclose((tau_q * q_dot).sum(axis=1), power, atol=1e-13)


# --- the four simulations ------------------------------------------------------------


@pytest.mark.parametrize("number", SIMULATIONS)
def test_starts_on_the_circle_at_rest(number: int) -> None:
    simulation = simulate_paper(number)
    assert_allclose(simulation.task_error[0], 0.0, atol=2e-8)
    assert_allclose(simulation.theta_dot[0], 0.0)
    assert simulation.t[0] == 0.0
    assert simulation.t[-1] == 10.0
    assert_allclose(np.diff(simulation.t), 0.01)


@pytest.mark.parametrize("number", SIMULATIONS)
def test_task_error_is_the_critically_damped_exponential(number: int) -> None:
    """e = (e_0 + (e_0' + 10 e_0) t) exp(-10 t), whatever the null space does."""
    simulation = simulate_paper(number)
    t = simulation.t[:, None]
    e_0, e_0_dot = simulation.task_error[0], np.array([0.0, 3.0])
    expected = (e_0 + (e_0_dot + 10.0 * e_0) * t) * np.exp(-10.0 * t)
    assert_allclose(simulation.task_error, expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("number", [3, 4])
def test_null_space_error_is_an_exponential(number: int) -> None:
    """‖e_N‖ = ‖e_N(0)‖ exp(-K_N t), Proposition 2.

    From a start of our own, off the circle: the paper's has equal relative angles, so
    that e_N(0) is 2e-7 in (3) and 0.1 in (4).
    """
    simulation = simulate_paper(number, duration=1.0, start=(0.2, 0.8, 1.9))
    norm = np.linalg.norm(simulation.null_space_error, axis=1)
    assert norm[0] > 1.0
    assert_allclose(norm, norm[0] * np.exp(-10.0 * simulation.t), rtol=1e-7)


@pytest.mark.parametrize("number", [3, 4])
def test_null_space_error_vanishes_on_the_papers_start(number: int) -> None:
    simulation = simulate_paper(number)
    norm = np.linalg.norm(simulation.null_space_error, axis=1)
    expected = norm[0] * np.exp(-10.0 * simulation.t)
    assert_allclose(norm, expected, rtol=0.0, atol=1e-10)


def test_null_space_error_stays_zero_in_the_second() -> None:
    """At rest and with g = 0 it starts at zero: there is never any self-motion."""
    assert_allclose(simulate_paper(2).null_space_error, 0.0, atol=1e-10)


def test_first_simulation_winds_up_while_it_tracks() -> None:
    simulation = simulate_paper(1)
    assert np.abs(simulation.theta[:, 0]).max() > 8.0
    assert np.abs(simulation.theta[:, 2]).max() > 15.0
    # Self-motion that the end effector does not show: it grows where e vanishes.
    speed = np.linalg.norm(simulation.null_space_error, axis=1)
    assert speed[simulation.t > 5.0].max() > 10.0
    assert_allclose(simulation.task_error[simulation.t > 5.0], 0.0, atol=1e-11)


def test_first_simulation_forgets_its_start() -> None:
    """Two starts 1e-9 rad apart end radians apart, but agree to 1e-7 for 2 s."""
    distance = distance_from_a_perturbed_start(1, duration=10.0)
    assert 1e-8 < distance[:201].max() < 1e-7
    assert distance[-1] > 1.0


@pytest.mark.parametrize(("number", "duration"), [(2, 4.0), (3, 2.0), (4, 2.0)])
def test_controlled_null_space_does_not_forget_its_start(
    number: int, duration: float
) -> None:
    distance = distance_from_a_perturbed_start(number, duration)
    assert distance.max() < 2.0 * PERTURBATION


def distance_from_a_perturbed_start(number: int, duration: float) -> Array:
    """Return the greatest difference of the angles on the grid, shape (n,)."""
    simulation = simulate_paper(number)
    start = simulation.theta[0] + [PERTURBATION, 0.0, 0.0]
    perturbed = simulate_paper(number, duration, start=start)
    difference = perturbed.theta - simulation.theta[: len(perturbed.t)]
    return np.abs(difference).max(axis=1)


def test_second_simulation_grazes_a_singularity() -> None:
    """det(JJᵀ) falls to 0.010 at the grid point 3.14 s, and to 0.0078 beside it."""
    simulation = simulate_paper(2)
    row = int(simulation.gram_determinant.argmin())
    assert simulation.t[row] == pytest.approx(3.14)
    assert simulation.gram_determinant[row] == pytest.approx(0.01015, abs=1e-5)
    fine = simulate_paper(2, duration=3.15, grid=0.0005)
    assert 0.0078 < fine.gram_determinant.min() < 0.0083


def test_third_simulation_keeps_away_from_singularities() -> None:
    assert simulate_paper(3).gram_determinant.min() > 1.02


def test_fourth_simulation_keeps_away_from_the_disk() -> None:
    simulation = simulate_paper(4)
    assert simulation.disk_distance.min() == pytest.approx(0.41587, abs=1e-5)
    assert simulation.gram_determinant.min() > 1.67


@pytest.mark.parametrize("number", SIMULATIONS)
def test_least_singular_value_is_numpys(number: int) -> None:
    simulation = simulate_paper(number)
    J = np.array([arm.jacobian(theta) for theta in simulation.theta])
    expected = np.linalg.svd(J, compute_uv=False)[:, -1]
    # √ of a difference: where both singular values meet only half the digits remain.
    assert_allclose(simulation.sigma_min, expected, atol=2e-8)


def test_equal_calls_share_one_result_that_cannot_be_changed() -> None:
    simulation = simulate_paper(3)
    assert simulate_paper(3, 10.0, 0.01, start=list(arm.START)) is simulation
    with pytest.raises(ValueError, match="read-only"):
        simulation.theta[0, 0] = 0.0
