"""The threshold grows with the feedback: it bounds the law's slope at singularities."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load
from states import moved
from task_cases import FRAMES, unit

from hsp_control import (
    Controller,
    FrameOrientation,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Robot,
    TargetPosture,
    engine,
)
from hsp_control.common.arrays import Array
from hsp_control.edge.threshold import (
    NOT,
    STIFFNESS,
    Following,
    Thresholds,
)
from hsp_control.null_space.fields import Rest

seeds = st.integers(0, 2**32 - 1)
LEAST = 0.03
SLOW = Following.of(0.8, on_legs=False)._replace(steepest=150.0, modest=1.3)
STEP = 1e-6  # step of differences; the law varies over ε ≥ 0.03


def written(
    demand: Array,
    ends: list[int],
    following: Following,
    *,
    yields: float = 1.0,
    pulls: float | Array = 0.0,
    whitened: float | Array = 1.0,
    turning: float = 0.0,
    parts: list[int] | None = None,
) -> tuple[float, Thresholds]:
    """Return the thresholds of spring levels under load, or of other levels."""
    m, thresholds = len(demand), Thresholds.allocate(len(ends), len(demand))
    J, pulling = np.ones((m, 7)), np.broadcast_to(pulls, m)
    springs = np.full(m, bool(pulling.any()))
    rows = {
        "ends": np.array(ends),
        "parts": np.array(ends if parts is None else parts),
        "demand": demand,
        "yields": np.full(m, yields),
        "pulls": np.array(pulling),
        "springs": springs,
        "stretched": np.zeros(m),
    }
    largest = engine.WriteThresholds(
        J=J,
        B=J * whitened,
        rows=rows,
        least=LEAST,
        turning=turning,
        following=following,
        thresholds=thresholds,
    )()
    return largest, thresholds


def how_held(lacking: float, wanted: float, following: Following) -> float:
    """Return the saturation of a level from squares of its deficit and demand."""
    return engine.HowHeld(
        lacking=lacking, wanted=wanted, least=LEAST, following=following
    )()


def threshold_below(
    demand: Array, held: float, above: float, thresholds: Thresholds
) -> float:
    """Return the threshold of the second level, which is rate-limited."""
    return engine.ThresholdBelow(
        demand=demand,
        held=held,
        above=above,
        level=1,
        following=SLOW,
        thresholds=thresholds,
    )()


@given(seeds, st.floats(-3.0, 6.0), st.floats(0.1, 10.0))
def test_it_bounds_the_feedback_over_its_square(
    seed: int, size: float, scale: float
) -> None:
    """‖f‖/ε² ≤ L + f_0/ε_0² for each level, and ε = ε_0 for small f.

    f_0 is that of legs; on a fixed base it is 0. In a metric that makes J L⁻ᵀ longer
    than J the same holds in the units of the rows, with ε_0 in the metric's own.
    """
    demand = 10.0**size * np.random.default_rng(seed).standard_normal(9)
    following = SLOW
    ends = [3, 3, 5, 9]
    largest, (own, *_) = written(demand, ends, following)
    _, scaled = written(demand, ends, following, whitened=scale)
    assert largest >= own.max()
    for f, epsilon in zip(np.split(demand, ends[:-1]), own, strict=True):
        norm = np.linalg.norm(f)
        assert norm <= (150.0 + 1.3 / LEAST**2) * epsilon**2 * (1.0 + 1e-12)
        assert epsilon >= LEAST
        if norm <= 1.3 + 0.99 * 150.0 * LEAST**2:
            assert epsilon == LEAST
    few, exact = written(demand, ends, following, yields=3.0)[1].own, own > LEAST
    np.testing.assert_allclose(few[exact] ** 2, 3.0 * own[exact] ** 2)
    unit = max(scale, 1.0)
    np.testing.assert_allclose(scaled.units, unit, rtol=1e-14)
    np.testing.assert_allclose(
        scaled.own, np.maximum(np.where(exact, own, 0.0), scaled.own.min())
    )
    assert scaled.own.min() >= LEAST / unit * (1.0 - 1e-14)
    for counts, kind in ((1.0, NOT), (0.0, following)):
        assert (written(demand, ends, kind, yields=counts)[1].own == LEAST).all()


@given(seeds, st.floats(0.0, 1.0))
def test_a_level_below_a_saturated_one_demands_less_than_that_one(
    seed: int, lacks: float
) -> None:
    """Along s it receives at most 2 s ‖f‖/ε²; when permanently saturated, 2 L s/40."""
    rng, following = np.random.default_rng(seed), SLOW
    demand, above = 10.0 ** rng.uniform(-1.0, 4.0, (2, 1)) * unit(rng, 3)
    square = above @ above
    held = how_held(lacks**2 * square, square, following)
    assert 0.0 <= held <= 1.0
    assert held == 0.0 or (lacks > 0.0 and square > 1.3**2)
    # it fades with the demand, so it is continuous where an error vanishes
    arm = following._replace(modest=0.0)
    least = how_held(lacks**2 * 1e-12 * square, 1e-12 * square, arm)
    assert least <= 1e-6 * np.sqrt(square) / (150.0 * LEAST**2)
    _, thresholds = written(np.zeros(6), [3, 6], following)
    below = threshold_below(demand, held, np.inf, thresholds)
    beyond = max(np.linalg.norm(demand) - 1.3, 0.0)
    assert below**2 == pytest.approx(held * beyond * 40.0 / 150.0)


@given(seeds, st.floats(-1.0, 3.0), st.floats(0.0, 1.0))
def test_a_level_below_follows_as_slowly_as_those_above_turn(
    seed: int, size: float, log_s: float
) -> None:
    """ε² = f size/(L s_1); and it is below s where all levels are resolved together."""
    rng, following = np.random.default_rng(seed), SLOW
    demand = 10.0**size * rng.standard_normal(6)
    largest, thresholds = written(demand, [3, 6], following)
    s = largest * 10.0 ** (log_s * rng.random(2))  # of both levels
    below = threshold_below(np.zeros(3), 0.0, s[0], thresholds)
    assert below**2 == pytest.approx(thresholds.follows[1] ** 2 * 0.8 / s[0])
    assert below <= s[1] * (1.0 + 1e-12)


@given(seeds)
def test_each_part_of_an_error_has_its_own_unit(seed: int) -> None:
    """The ratio of its rows in the metric's coordinates and in the joints', at least 1.

    So an inverse that light wrists make large damps no position.
    """
    scales = 10.0 ** np.random.default_rng(seed).uniform(-1.0, 2.0, 3)
    rows = np.repeat(scales, 3)[:, None]
    _, found = written(np.zeros(9), [6, 9], SLOW, whitened=rows, parts=[3, 6, 9])
    expected = np.repeat(np.maximum(scales, 1.0), 3)
    np.testing.assert_allclose(found.units, expected, rtol=1e-14)
    _, plain = written(np.zeros(9), [6, 9], NOT, whitened=rows, parts=[3, 6, 9])
    np.testing.assert_array_equal(plain.units, 1.0)  # an edge that is disabled


@given(seeds, st.floats(0.01, 2.0))
def test_springs_have_the_demand_of_a_field_in_proportion_to_force(
    seed: int, pull: float
) -> None:
    rng, following = np.random.default_rng(seed), SLOW
    pulls = np.zeros(6)
    pulls[:3] = pull * unit(rng, 3)
    springs: dict[str, Any] = {"yields": 0.0, "pulls": pulls, "turning": 0.05}
    f = rng.standard_normal(6)
    largest, (own, *_) = written(f, [3, 6], following, **springs)
    assert largest == max(own)
    assert own[0] == pytest.approx(max(LEAST, 0.05 * min(pull, 1.0)))


class Slopes(NamedTuple):
    """Slope of a law in q, and its bound: spectral norms."""

    found: float
    bound: float


def near_singular(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a random configuration near a singular one, and its lost direction."""
    q, frame = robot.random_configuration(rng), FRAMES[robot.name]
    if rng.random() < 0.3:  # stretched
        q = robot.neutral()
    for _ in range(12):
        J, tensor = position_jacobian(robot, q, frame)
        U, s, Vt = np.linalg.svd(J)
        slope = np.einsum("i,kij,j->k", U[:, -1], tensor, Vt[len(s) - 1])
        if s[-1] > 1e-9:
            step = -s[-1] * slope / max(slope @ slope, 1e-6)
            q = robot.integrate(q, step * min(1.0, 0.5 / np.linalg.norm(step)))
    away = 10.0 ** rng.uniform(-5.0, -0.3) * unit(rng, robot.nv)
    return robot.integrate(q, away), U[:, -1]


def position_jacobian(robot: Robot, q: Array, frame: str) -> tuple[Array, Array]:
    """Return J of a position and ∂J/∂q, shape (nv, m, nv)."""
    m = 2 if robot.name == "planar3r" else 3

    def J(step: Array) -> Array:
        state = moved(robot, 0.0, robot.integrate(q, step))
        return state.frame(frame).jacobian[:m].copy()

    steps = STEP * np.eye(robot.nv)
    return J(np.zeros(robot.nv)), np.array([J(d) - J(-d) for d in steps]) / (2.0 * STEP)


def slopes(robot: Robot, q: Array, target: Array) -> Slopes:
    """Return the slope of a(q) at rest, g = 0, and the bound of the proposition.

    Then a = J#f, with J# = V φ(s) Uᵀ, φ = s (2 - s²/ε²)/ε² below ε, 1/s above. The
    slope of φ is at most 2/ε²; so is, for an odd function of singular values, that of
    J# for one of J in the norm of Frobenius. Where f changes there is in addition
    max φ = 1.09/ε times its slope, and by dε²/df = 1/L, |∂φ/∂ε²| ≤ 0.77/ε³ another
    0.77 ‖f‖/(L ε³):

        ‖∂a/∂q‖ ≤ 2 ‖f‖/ε² ‖∂J/∂q‖ + (1.09 + 0.77 ‖f‖/(L ε²)) ‖∂f/∂q‖/ε

    with ε as the law ought to have it; then ‖f‖/ε² ≤ L, see above.
    """
    axes = "xyz"[: len(target)]
    hand = FramePosition(
        FRAMES[robot.name], Hold(target), axes=axes, gains=Gains(natural_frequency=10.0)
    )
    controller = Controller(robot, [hand], Rest(), limits=None)

    def law(step: Array) -> tuple[Array, Array]:
        at_rest = np.zeros(robot.nv)
        out = controller.compute(0.0, robot.integrate(q, step), at_rest)
        return out.acceleration.copy(), out.task.acceleration.copy()

    L, least = STIFFNESS / robot.size, controller.singularity_threshold
    pairs = [(law(d), law(-d)) for d in STEP * np.eye(robot.nv)]
    a, f = (
        np.array([ahead[k] - behind[k] for ahead, behind in pairs]) / (2.0 * STEP)
        for k in range(2)
    )
    norm = np.linalg.norm(law(np.zeros(robot.nv))[1])
    square = max(least**2, norm / L)
    _, tensor = position_jacobian(robot, q, FRAMES[robot.name])
    bends = np.linalg.norm(tensor.reshape(robot.nv, -1), 2)
    smooth = (1.09 + 0.77 * norm / (L * square)) / np.sqrt(square)
    bound = 2.0 * norm / square * bends + smooth * np.linalg.norm(f, 2)
    return Slopes(float(np.linalg.norm(a, 2)), float(bound))


def drawn(name: str, seed: int) -> Slopes:
    """Return the slopes at a random state, with a target at up to 1 km."""
    robot, rng = load(name), np.random.default_rng(seed)
    q, lost = near_singular(robot, rng)
    here = robot.state(0.0, q, np.zeros(robot.nv)).position(FRAMES[name])[: len(lost)]
    along = lost if rng.random() < 0.5 else unit(rng, len(lost))
    away = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 3.0)
    return slopes(robot, q, here + away * along)


@pytest.mark.parametrize("name", ["planar3r", "panda", "ur5"])
@given(seeds)
@settings(max_examples=25)
def test_the_law_is_nowhere_steep(name: str, seed: int) -> None:
    found, bound = drawn(name, seed)
    assert found <= bound * (1.0 + 1e-5)


def slope_in_v(controller: Controller, q: Array, v: Array) -> Array:
    """Return ∂a/∂v, exact but for rounding: a has no higher power of v than v²."""
    size = 1e-2 * (1.0 + float(np.linalg.norm(v)))

    def a(v: Array) -> Array:
        return controller.compute(0.0, q, v).acceleration.copy()

    steps = size * np.eye(len(v))
    return np.array([a(v + d) - a(v - d) for d in steps]).T / (2.0 * size)


@pytest.mark.parametrize("name", ["planar3r", "panda", "ur5"])
@given(seeds)
@settings(max_examples=25)
def test_no_target_makes_it_steep_in_v(name: str, seed: int) -> None:
    """J#J and P have eigenvalues in [0, 1]; ε does not depend on the speed."""
    robot, rng = load(name), np.random.default_rng(seed)
    q, lost = near_singular(robot, rng)
    target = 10.0 ** rng.uniform(-3.0, 3.0) * unit(rng, len(lost))
    hand = FramePosition(FRAMES[name], Hold(target), axes="xyz"[: len(lost)])
    Kv, K_N = 20.0, rng.uniform(1.0, 40.0)
    field = TargetPosture(robot.random_configuration(rng))
    controller = Controller(robot, [hand], field, null_space_gain=K_N, limits=None)
    v = 10.0 ** rng.uniform(-3.0, 0.0) * unit(rng, robot.nv)
    g = controller.compute(0.0, q, v).field.g
    _, tensor = position_jacobian(robot, q, FRAMES[name])
    bends = np.linalg.norm(tensor.reshape(robot.nv, -1), 2)
    law = controller.active_stack.law
    (epsilon,) = law.thresholds
    speeds = 3.0 * np.linalg.norm(v) + np.linalg.norm(g - v)
    bound = max(Kv, K_N) + 1.0 + 1.09 * speeds * bends / epsilon  # ∂g/∂q = -1
    assert np.linalg.norm(slope_in_v(controller, q, v), 2) <= bound * (1.0 + 1e-6)


@pytest.mark.parametrize("name", ["panda", "ur5"])
@given(seeds)
@settings(max_examples=25)
def test_levels_share_one_damping_wherever_their_targets_are(
    name: str, seed: int
) -> None:
    """At rest, g = 0: ∂a/∂v = -Kv (1 - P) - K_N P², with 0 ≤ P ≤ 1."""
    robot, rng = load(name), np.random.default_rng(seed)
    q, _ = near_singular(robot, rng)
    Kv, K_N, rest = 20.0, rng.uniform(1.0, 40.0), np.zeros(robot.nv)
    here = robot.state(0.0, q, rest).position(FRAMES[name])
    target = Hold(here + 10.0 ** rng.uniform(-4.0, 3.0) * unit(rng, 3))
    near = robot.integrate(q, 10.0 ** rng.uniform(-4.0, 0.0) * unit(rng, robot.nv))
    tasks = [
        FramePosition(FRAMES[name], target, priority=1),
        FrameOrientation(FRAMES[name], priority=2),
        JointPosture(near, joints=robot.joint_names[:2], priority=3),
    ]
    controller = Controller(
        robot, tasks, Rest(), null_space_gain=K_N, limits=None, start=near
    )
    found = slope_in_v(controller, q, rest)
    scale = max(Kv, K_N)
    np.testing.assert_allclose(found, found.T, atol=1e-6 * scale)
    # K_N P² + Kv (1 - P) has its least where 2 K_N P = Kv.
    least = Kv - Kv**2 / (4.0 * K_N) if Kv < 2.0 * K_N else K_N
    rates = -np.linalg.eigvalsh(found)
    assert rates.min() >= least - 1e-6 * scale
    assert rates.max() <= scale * (1.0 + 1e-6)
