"""The law that the paper prints, on the hand-written planar arm, against its theorems.

The arm's own terms (M, N, J, J', g, g', a and tau) are those of the package at random
states to 1e-12: test_paper.py. Here is what rests on none of the package.
"""

from collections.abc import Callable

import numpy as np
import planar_arm as arm
import pytest
from numpy.testing import assert_allclose
from planar_arm import Array, simulate_paper

SIMULATIONS = (1, 2, 3, 4)


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


def test_pseudo_inverse_rate_is_its_derivative(rng: np.random.Generator) -> None:
    _, theta, v = random_state(rng)
    J, J_dot = arm.jacobian(theta), arm.jacobian_rate(theta, v)
    expected = derivative(lambda s: arm.pseudo_inverse(arm.jacobian(theta + s * v)))
    assert_allclose(arm.pseudo_inverse_rate(J, J_dot), expected, atol=1e-9)


# --- the law at one state ------------------------------------------------------------


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


# --- the four simulations ------------------------------------------------------------


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
