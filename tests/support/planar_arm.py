"""The planar 3-link arm of Hsu, Hauser and Sastry (1989), by hand: an oracle for tests.

Nothing here comes from Pinocchio or from hsp_control, and the law stands as the paper
prints it, with its derivative of the pseudo-inverse, so that an error in our short form
cannot hide in both. Plain NumPy, one state at a time, not optimised.

The arm: unit links, a unit point mass at each link's end, no gravity. As in the paper
the angles θ are ABSOLUTE, measured from the horizontal; the last section converts to
the relative angles q of a URDF. SI units, plane coordinates (x, y).

References:
    P. Hsu, J. Hauser, S. Sastry, "Dynamic Control of Redundant Manipulators", Journal
    of Robotic Systems 6(2), 133-148, 1989.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

TASK_STIFFNESS = 100.0  # K_p = 100 I [1/s²]
TASK_DAMPING = 20.0  # K_v = 20 I [1/s]: critically damped, both poles at -10
NULL_SPACE_GAIN = 10.0  # K_N [1/s]
ANGULAR_RATE = 3.0  # of the circle and of the disk [rad/s]

# Eight digits, as given: the end effector starts within 1e-8 m of the point (2, 1).
START = (-0.44090929, 0.46364761, 1.36820450)
MIRRORED_START = START[::-1]

# Masses moved by both joint i and joint j: 4 - max(i, j), counting from one [kg].
CARRIED = np.array([[3.0, 2.0, 1.0], [2.0, 2.0, 1.0], [1.0, 1.0, 1.0]])

# r3 - r2 = θ1 - 2 θ2 + θ3 for the relative angles r2 = θ2 - θ1 and r3 = θ3 - θ2.
SPREAD = np.array([1.0, -2.0, 1.0])

# Angles that move joint two (row 1: the first) and joint three (row 2: the first two).
MOVERS = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])

IDENTITY = np.eye(3)


# --- kinematics ----------------------------------------------------------------------


def joint_positions(theta: Array) -> Array:
    """Return the ends of links 1, 2, 3, shape (3, 2): joint two, joint three, the tip.

    p_k = Σ_{i ≤ k} (cos θ_i, sin θ_i). Joint one is the origin.
    """
    return np.array([np.cos(theta), np.sin(theta)]).T.cumsum(axis=0)


def forward_kinematics(theta: Array) -> Array:
    """Return the end effector's position x, shape (2,)."""
    return joint_positions(theta)[2]


def jacobian(theta: Array) -> Array:
    """Return J = ∂x/∂θ, shape (2, 3): column i is (-sin θ_i, cos θ_i)."""
    return np.array([-np.sin(theta), np.cos(theta)])


def jacobian_rate(theta: Array, theta_dot: Array) -> Array:
    """Return J', shape (2, 3): column i is -(cos θ_i, sin θ_i) θ_i'."""
    return -np.array([np.cos(theta), np.sin(theta)]) * theta_dot


def pseudo_inverse(J: Array) -> Array:
    """Return J⁺ = Jᵀ(JJᵀ)⁻¹, shape (3, 2)."""
    return J.T @ inverse_2x2(J @ J.T)


def pseudo_inverse_rate(J: Array, J_dot: Array) -> Array:
    """Return (J⁺)', shape (3, 2), by the product rule on Jᵀ S with S = (JJᵀ)⁻¹.

    (J⁺)' = J'ᵀ S + Jᵀ S', S' = -S (J'Jᵀ + JJ'ᵀ) S.
    """
    S = inverse_2x2(J @ J.T)
    S_dot = -S @ (J_dot @ J.T + J @ J_dot.T) @ S
    return J_dot.T @ S + J.T @ S_dot


def gram_determinant(J: Array) -> float:
    """Return det(JJᵀ) = sin²(θ2-θ1) + sin²(θ3-θ1) + sin²(θ3-θ2), from 0 to 9/4.

    The sum of the squared 2 × 2 minors (Cauchy and Binet) loses no digits near a
    singularity.
    """
    (x1, x2, x3), (y1, y2, y3) = J.tolist()
    areas = x1 * y2 - x2 * y1, x1 * y3 - x3 * y1, x2 * y3 - x3 * y2
    return float(sum(area**2 for area in areas))


def inverse_2x2(G: Array) -> Array:
    """Return G⁻¹ by Cramer's rule."""
    (a, b), (c, d) = G.tolist()
    return np.array([[d, -b], [-c, a]]) / (a * d - b * c)


# --- dynamics: M(θ) θ'' + N(θ, θ') = τ -----------------------------------------------


def mass_matrix(theta: Array) -> Array:
    """Return M, M_ij = (4 - max(i, j)) cos(θ_i - θ_j) [kg m²].

    From T = ½ Σ_k |p_k'|²: links i and j both move the 4 - max(i, j) masses beyond
    them, and their unit velocities enclose the angle θ_i - θ_j.
    """
    return CARRIED * np.cos(theta[:, None] - theta[None, :])


def nonlinear_effects(theta: Array, theta_dot: Array) -> Array:
    """Return N, N_i = Σ_j (4 - max(i, j)) sin(θ_i - θ_j) θ_j'² [N m].

    Only squares: in absolute angles Lagrange's equations have no Coriolis products.
    """
    return CARRIED * np.sin(theta[:, None] - theta[None, :]) @ theta_dot**2


def forward_dynamics(theta: Array, theta_dot: Array, tau: Array) -> Array:
    """Return θ'' = M⁻¹(τ - N)."""
    M, N = mass_matrix(theta), nonlinear_effects(theta, theta_dot)
    return np.linalg.solve(M, tau - N)


# --- the task: a circle --------------------------------------------------------------


def circle(t: float) -> tuple[Array, Array, Array]:
    """Return x_d = (1 + cos 3t, 1 + sin 3t), x_d' and x_d''."""
    w = ANGULAR_RATE
    c, s = np.cos(w * t), np.sin(w * t)
    x_d = np.array([1.0 + c, 1.0 + s])
    return x_d, w * np.array([-s, c]), -(w**2) * np.array([c, s])


# --- the gradients of the costs f, and their total rates -----------------------------


def equal_angles_gradient(theta: Array) -> Array:
    """Return ∇f = 10 (r3 - r2) ∂(r3 - r2)/∂θ."""
    return 10.0 * SPREAD * (SPREAD @ theta)


def equal_angles_gradient_rate(theta_dot: Array) -> Array:
    """Return (∇f)'; the gradient is linear in θ."""
    return equal_angles_gradient(theta_dot)


def disk_center(t: float) -> tuple[Array, Array]:
    """Return the disk's centre c = (-1, 1.7 + 0.75 cos 3t) and c'."""
    w = ANGULAR_RATE
    c = np.array([-1.0, 1.7 + 0.75 * np.cos(w * t)])
    return c, np.array([0.0, -0.75 * w * np.sin(w * t)])


def disk_distances(t: float, theta: Array) -> Array:
    """Return d2, d3: from joints two and three to the disk's centre, shape (2,)."""
    r = joint_positions(theta)[:2] - disk_center(t)[0]
    return np.sqrt((r**2).sum(axis=1))


def disk_cost_gradient(t: float, theta: Array) -> Array:
    """Return ∇f = Σ -2 J_kᵀ r_k / d_k⁴ with r_k from the centre to the joint.

    J_k, the Jacobian of the end of link k, is J without the columns of the links
    beyond. Rows are links below: row k of r J is Jᵀ r_k.
    """
    J = jacobian(theta)
    r = joint_positions(theta)[:2] - disk_center(t)[0]
    square = (r**2).sum(axis=1, keepdims=True)
    return -2.0 * (MOVERS * (r @ J) / square**2).sum(axis=0)


def disk_cost_gradient_rate(t: float, theta: Array, theta_dot: Array) -> Array:
    """Return (∇f)' by the product rule on ∇f = Σ -2 J_kᵀ r_k / d_k⁴.

    (∇f)' = Σ -2 (J_k'ᵀ r_k + J_kᵀ r_k') / d_k⁴ + 8 (r_kᵀ r_k') J_kᵀ r_k / d_k⁶.
    r_k' = J_k θ' - c': the disk's motion, ∂∇f/∂t, enters through c'.
    """
    c, c_dot = disk_center(t)
    J, J_dot = jacobian(theta), jacobian_rate(theta, theta_dot)
    r = joint_positions(theta)[:2] - c
    r_dot = (MOVERS * theta_dot) @ J.T - c_dot
    square = (r**2).sum(axis=1, keepdims=True)
    half_square_dot = (r * r_dot).sum(axis=1, keepdims=True)
    turning = -2.0 * MOVERS * (r @ J_dot + r_dot @ J) / square**2
    receding = 8.0 * MOVERS * half_square_dot * (r @ J) / square**3
    return (turning + receding).sum(axis=0)


def cost_gradient(number: int, t: float, theta: Array) -> Array:
    """Return ∇f, the partial derivative at fixed t."""
    if number <= 2:
        return np.zeros(3)
    if number == 3:
        return equal_angles_gradient(theta)
    return equal_angles_gradient(theta) + disk_cost_gradient(t, theta)


def cost_gradient_rate(number: int, t: float, theta: Array, theta_dot: Array) -> Array:
    """Return (∇f)', the TOTAL derivative along the motion."""
    if number <= 2:
        return np.zeros(3)
    rate = equal_angles_gradient_rate(theta_dot)
    if number == 3:
        return rate
    return rate + disk_cost_gradient_rate(t, theta, theta_dot)


# --- the law, as printed -------------------------------------------------------------


class PaperLaw(NamedTuple):
    """Eqs. (7) and (13) at one state.

    Attributes:
        tau: Torques on the absolute angles, shape (3,).
        acceleration: The bracket of eq. (7), the commanded θ'', shape (3,).
        task_error: e = x_d - x, shape (2,).
        task_error_rate: e', shape (2,).
        null_space_error: e_N, shape (3,).
        gram_determinant: det(JJᵀ).
    """

    tau: Array
    acceleration: Array
    task_error: Array
    task_error_rate: Array
    null_space_error: Array
    gram_determinant: float


def null_space_law(
    J: Array, J_dot: Array, g: Array, g_dot: Array, v: Array
) -> tuple[Array, Array]:
    """Return φ_N and e_N = (I - J⁺J)(g - v).

    φ_N = (I - J⁺J)(g' + K_N e_N) - (J⁺J'J⁺ + (J⁺)') J (g - v), eq. (13).
    """
    K_N = NULL_SPACE_GAIN
    J_plus, J_plus_dot = pseudo_inverse(J), pseudo_inverse_rate(J, J_dot)
    P = IDENTITY - J_plus @ J
    e_N = P @ (g - v)
    turning = (J_plus @ J_dot @ J_plus + J_plus_dot) @ J
    phi_N = P @ (g_dot + K_N * e_N) - turning @ (g - v)
    return phi_N, e_N


def law(
    t: float, theta: Array, theta_dot: Array, field: tuple[Array, Array] | None
) -> PaperLaw:
    """Return τ = M [J⁺(x_d'' + K_v e' + K_p e - J'v) + φ_N] + N, eq. (7).

    The task is the circle.

    Args:
        t: Time [s].
        theta: Absolute angles θ, shape (3,) [rad].
        theta_dot: Their rates v = θ', shape (3,) [rad/s].
        field: g and its total rate g' for eq. (13), or None for φ_N = 0; e_N is then
            given for g = 0: minus the uncontrolled self-motion.

    Returns:
        The torques and their parts.
    """
    K_p, K_v, v = TASK_STIFFNESS, TASK_DAMPING, theta_dot
    J, J_dot = jacobian(theta), jacobian_rate(theta, theta_dot)
    x_d, x_d_dot, x_d_ddot = circle(t)
    e = x_d - forward_kinematics(theta)
    e_dot = x_d_dot - J @ v

    J_plus = pseudo_inverse(J)
    if field is None:
        phi_N, e_N = np.zeros(3), (IDENTITY - J_plus @ J) @ -v
    else:
        phi_N, e_N = null_space_law(J, J_dot, *field, v)

    acceleration = J_plus @ (x_d_ddot + K_v * e_dot + K_p * e - J_dot @ v) + phi_N
    return PaperLaw(
        tau=mass_matrix(theta) @ acceleration + nonlinear_effects(theta, v),
        acceleration=acceleration,
        task_error=e,
        task_error_rate=e_dot,
        null_space_error=e_N,
        gram_determinant=gram_determinant(J),
    )


def paper_law(number: int, t: float, theta: Array, theta_dot: Array) -> PaperLaw:
    """Return the law of simulation (1) to (4) at a state.

    (1) φ_N = 0; (2) g = 0; (3) g = -∇f, f = 5 (r3 - r2)²; (4) f + 1/d2² + 1/d3².
    """
    if number not in (1, 2, 3, 4):
        raise ValueError(f"the paper has simulations 1 to 4, not {number}")
    if number == 1:
        return law(t, theta, theta_dot, None)
    g = -cost_gradient(number, t, theta)
    g_dot = -cost_gradient_rate(number, t, theta, theta_dot)
    return law(t, theta, theta_dot, (g, g_dot))


# --- the four simulations ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PlanarSimulation:
    """A closed loop on an even time grid; row i of every array is time t[i]. Read-only.

    Attributes:
        number: Simulation (1) to (4).
        t: Time, shape (n,) [s].
        theta: Absolute angles, shape (n, 3) [rad].
        theta_dot: Their rates, shape (n, 3) [rad/s].
        theta_ddot: Their accelerations, shape (n, 3) [rad/s²].
        tau: Torques on the absolute angles, shape (n, 3) [N m].
        gram_determinant: det(JJᵀ), shape (n,).
        task_error: e, shape (n, 2) [m].
        null_space_error: e_N, shape (n, 3) [rad/s]; in (1) that of g = 0.
    """

    number: int
    t: Array
    theta: Array
    theta_dot: Array
    theta_ddot: Array
    tau: Array
    gram_determinant: Array
    task_error: Array
    null_space_error: Array

    @property
    def sigma_min(self) -> Array:
        """J's least singular value, shape (n,): σ² = (3 - √(9 - 4 det JJᵀ)) / 2.

        J's columns have unit length, so that trace(JJᵀ) = 3 everywhere. Written as
        2 det / (3 + √...) to keep its digits where σ is small.
        """
        det = self.gram_determinant
        # Rounding can lift det above 9/4, where the two singular values meet.
        root = np.sqrt(np.maximum(9.0 - 4.0 * det, 0.0))
        return np.sqrt(2.0 * det / (3.0 + root))


@lru_cache(maxsize=32)
def simulate_paper(number: int, duration: float = 10.0) -> PlanarSimulation:
    """Return simulation (1) to (4) of the paper, from rest; equal calls are cached.

    The law is evaluated inside the integrator's stages. Against runs whose steps end
    on every grid point (rtol 2e-14) the angles of (2) to (4) are good to 1e-12 and the
    rates to 2e-11, in (2) to 4e-10 where it grazes a singularity at 3.14 s. The angles
    of (1) lose a digit a second: they are good to 1e-13 at 2 s, 1e-10 at 5 s, 1e-3 at
    10 s, so a second implementation should be compared for 2 s only.

    Args:
        number: Which of the four.
        duration: Length [s], a multiple of 0.01 s, the distance of the rows.

    Returns:
        The motion and the law's values along it.
    """
    start = MIRRORED_START if number == 4 else START

    def closed_loop(t: float, y: Array) -> Array:
        theta, theta_dot = y[:3], y[3:]
        tau = paper_law(number, t, theta, theta_dot).tau
        return np.concatenate([theta_dot, forward_dynamics(theta, theta_dot, tau)])

    solution = solve_ivp(
        closed_loop,
        (0.0, duration),
        np.concatenate([start, np.zeros(3)]),
        method="DOP853",
        t_eval=np.linspace(0.0, duration, round(duration / 0.01) + 1),
        rtol=1e-13,
        atol=1e-13,
    )
    if not solution.success:
        raise RuntimeError(f"simulation ({number}): {solution.message}")

    t, theta, theta_dot = solution.t, solution.y[:3].T, solution.y[3:].T
    states = list(zip(t, theta, theta_dot, strict=True))
    laws = [paper_law(number, *state) for state in states]
    simulation = PlanarSimulation(
        number=number,
        t=t,
        theta=theta,
        theta_dot=theta_dot,
        # The plant's answer to τ, not the command it should equal.
        theta_ddot=np.array(
            [
                forward_dynamics(*state[1:], row.tau)
                for state, row in zip(states, laws, strict=True)
            ]
        ),
        tau=np.array([row.tau for row in laws]),
        gram_determinant=np.array([row.gram_determinant for row in laws]),
        task_error=np.array([row.task_error for row in laws]),
        null_space_error=np.array([row.null_space_error for row in laws]),
    )
    # The cached result is shared by many tests: none may change it.
    for value in vars(simulation).values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return simulation


# --- absolute and relative angles ----------------------------------------------------
#
# θ = A q with A the lower triangle of ones; the same for velocities, and for
# accelerations. By virtual work τ_relᵀ δq = τ_absᵀ A δq, hence τ_rel = Aᵀ τ_abs.
# All four act on the last axis, so that whole trajectories can be converted.

A = np.tril(np.ones((3, 3)))
A_INVERSE = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])


def absolute_from_relative(q: Array) -> Array:
    """Return θ = A q, shape (..., 3); also for rates and accelerations."""
    return q @ A.T


def relative_from_absolute(theta: Array) -> Array:
    """Return q = A⁻¹ θ, shape (..., 3); also for rates and accelerations."""
    return theta @ A_INVERSE.T


def relative_torque(tau: Array) -> Array:
    """Return τ_rel = Aᵀ τ_abs, shape (..., 3)."""
    return tau @ A


def absolute_torque(tau: Array) -> Array:
    """Return τ_abs = A⁻ᵀ τ_rel, shape (..., 3)."""
    return tau @ A_INVERSE
