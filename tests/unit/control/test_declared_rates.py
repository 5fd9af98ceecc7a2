"""A wrong user-defined rate is reported at the first step, and only then."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.linalg import cholesky

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import MetricError, RateError
from hsp_control.declaration import imported
from hsp_control.declaration.language import in_yaml
from hsp_control.engine.plans import PartCall
from hsp_control.law import VARYING
from hsp_control.null_space.fields import FunctionField, StateWeight, VectorField

ROBOT = hsp.Robot.load("panda")
HOME = ROBOT.home()
A = np.random.default_rng(0).normal(size=(7, 7))


# The true ones: f = Σ sin(A q + t), its gradient, the rate of that, and a field.


def f(s: hsp.RobotState) -> float:
    return float(np.sin(A @ s.q + s.t).sum())


def slope(s: hsp.RobotState) -> Array:
    return np.asarray(np.cos(A @ s.q + s.t) @ A)


def slope_rate(s: hsp.RobotState) -> Array:
    return np.asarray(-(np.sin(A @ s.q + s.t) * (A @ s.v + 1.0)) @ A)


def g(s: hsp.RobotState) -> Array:
    return np.asarray(np.sin(A @ s.q + s.t))


def g_rate(s: hsp.RobotState) -> Array:
    return np.asarray(np.cos(A @ s.q + s.t) * (A @ s.v + 1.0))


def still(rate: Callable[[hsp.RobotState], Array]) -> Callable[..., Array]:
    """Return a rate without the partial derivative in time."""

    def of(s: hsp.RobotState) -> Array:
        rest = s.robot.state(s.t, s.q, np.zeros(7))
        return rate(s) - rate(rest)

    return of


WRONG: dict[str, Callable[[Any], Any]] = {
    "right": lambda rate: rate,
    "of the other sign": lambda rate: lambda s: -rate(s),
    "1 % too large": lambda rate: lambda s: 1.01 * rate(s),
    "zero": lambda rate: lambda s: 0.0 * rate(s),
    "without the time": still,
    "wrong in one joint": lambda rate: lambda s: rate(s) * [1.0] * 6 + [0.9],
}


class Vector(VectorField):
    """A field defined by its methods."""

    by: Any

    def vector(self, state: hsp.RobotState) -> Array:
        return g(state)

    def rate(self, state: hsp.RobotState) -> Array:
        return np.asarray(self.by(state))


class Direct(hsp.NullSpaceField):
    """A field without a common base class's method."""

    by: Any

    def evaluate(self, state: Any, metric: Any, form: Any, out: Any) -> Any:
        out.g[:], out.g_dot[:] = g(state), self.by(state)
        return out

    def value(self, state: hsp.RobotState) -> float:
        return 0.0


class Slope(hsp.Cost):
    """A cost with a gradient, and its rate."""

    by: Any
    gradient_by: Any = slope

    def value(self, state: hsp.RobotState) -> float:
        return f(state)

    def gradient(self, state: hsp.RobotState) -> Array:
        return np.asarray(self.gradient_by(state))

    def gradient_rate(self, state: hsp.RobotState) -> Array:
        return np.asarray(self.by(state))


class Both(hsp.Cost):
    """A cost with gradient and rate in one method."""

    by: Any

    def value(self, state: hsp.RobotState) -> float:
        return f(state)

    def differentiate(self, state: Any, gradient: Array, rate: Array) -> None:
        gradient[:], rate[:] = slope(state), self.by(state)


def _square(q: Array, v: Array, factor: float, gradient: Array, rate: Array) -> float:
    total = 0.0
    for i in range(gradient.shape[0]):
        total += q[i] * q[i]
        gradient[i], rate[i] = 2.0 * q[i], 2.0 * factor * v[i]
    return total


class Kernel(hsp.Cost):
    """A cost defined by a kernel."""

    factor: float

    def call(self, state: hsp.RobotState) -> PartCall:
        return PartCall(_square, q=state.q, v=state.v, factor=self.factor)


class Reach(hsp.fields.JacobianCost):
    """A cost of a frame's Jacobian, defined by its terms."""

    slope_factor: float = 1.0
    rate_factor: float = 1.0

    def terms(self, J: Array, J_dot: Array) -> Any:
        slope, rate = -self.slope_factor * J, -self.rate_factor * J_dot
        return hsp.fields.JacobianTerms(-0.5 * float((J * J).sum()), slope, rate)


class Swell(hsp.fields.Weight):
    """A weight defined by its method."""

    by: Any

    def sample(self, state: hsp.RobotState) -> tuple[float, float]:
        w_dot = float(np.cos(state.q[0] + state.t) * (state.v[0] + 1.0))
        return 2.0 + np.sin(state.q[0] + state.t), float(
            self.by(lambda s: w_dot)(state)
        )


class Lengthened(hsp.metrics.Metric):
    """W = (2 + sin q_0) I."""

    form = VARYING
    factor: float

    def evaluate(self, state: hsp.RobotState, out: Any) -> Any:
        size = 2.0 + np.sin(state.q[0])
        out.W[:], out.L[:] = size * np.eye(7), np.sqrt(size) * np.eye(7)
        out.W_dot[:] = self.factor * np.cos(state.q[0]) * state.v[0] * np.eye(7)
        return out


WAYS: dict[str, tuple[Callable[[Any], Any], Callable[..., Array], str]] = {
    "FunctionField": (
        lambda rate: FunctionField(g, rate_function=rate, name="mine"),
        g_rate,
        "field.0: field 'mine': rate_function is wrong: g' = ",
    ),
    "FunctionCost": (
        lambda rate: hsp.FunctionCost(f, rate_function=rate, name="mine"),
        slope_rate,
        "field.0: cost 'mine': rate_function is wrong: (∇f)' = ",
    ),
    "FunctionCost with its gradient": (
        lambda rate: hsp.FunctionCost(f, gradient_function=slope, rate_function=rate),
        slope_rate,
        "cost 'function_cost': rate_function is wrong: (∇f)' = ",
    ),
    "VectorField.rate": (Vector, g_rate, "field 'vector': Vector.rate is wrong: g' = "),
    "NullSpaceField.evaluate": (
        Direct,
        g_rate,
        "field 'direct': Direct.evaluate is wrong: g' = ",
    ),
    "Cost.gradient_rate": (
        Slope,
        slope_rate,
        "cost 'slope': Slope.gradient_rate is wrong: (∇f)' = ",
    ),
    "Cost.differentiate": (
        Both,
        slope_rate,
        "cost 'both': Both.differentiate is wrong: (∇f)' = ",
    ),
    "in a sum": (
        lambda rate: hsp.JointCentering() + 3.0 * FunctionField(g, rate_function=rate),
        g_rate,
        "field.1: field 'function_field': rate_function is wrong: g' = ",
    ),
}


def controller(field: Any, **options: Any) -> hsp.Controller:
    return hsp.Controller(ROBOT, [hsp.FramePosition("panda_tcp")], field, **options)


def first_step(field: Any, t: float = 0.0, **options: Any) -> hsp.ControlOutput:
    return controller(field, **options).compute(t, HOME, np.zeros(7))


@pytest.mark.parametrize("how", WRONG)
@pytest.mark.parametrize("way", WAYS)
def test_a_wrong_rate_is_named(way: str, how: str) -> None:
    make, rate, words = WAYS[way]
    field = make(WRONG[how](rate))
    if how == "right":
        first_step(field)
        return
    with pytest.raises(RateError) as caught:
        first_step(field)
    message = str(caught.value)
    assert words in message
    assert "a difference of" in message
    assert message.endswith(
        "correct it, or leave rate_function out: the package then takes differences"
        if "rate_function" in words
        else "correct it"
    )
    if how == "of the other sign":
        assert "so that it is -1 times the true rate" in message


def test_a_wrong_gradient_is_named() -> None:
    double = WRONG["1 % too large"](slope)
    words = "gradient_function is wrong: ∇f·v is .*, so that it is 1.01 times"
    with pytest.raises(RateError, match=words):
        first_step(hsp.FunctionCost(f, gradient_function=double))
    with pytest.raises(RateError, match=r"Slope\.gradient is wrong: ∇f·v"):
        first_step(Slope(lambda s: 1.01 * slope_rate(s), gradient_by=double))


def test_a_wrong_kernel_is_named() -> None:
    first_step(Kernel(1.0))
    with pytest.raises(RateError, match=r"Kernel\.call is wrong.* 0.5 times"):
        first_step(Kernel(0.5))


def test_wrong_terms_of_a_jacobian_are_named() -> None:
    first_step(Reach("panda_tcp"))
    with pytest.raises(RateError, match=r"Reach\.terms is wrong: \(∇f\)'"):
        first_step(Reach("panda_tcp", rate_factor=0.9))
    with pytest.raises(RateError, match=r"Reach\.terms is wrong: ∇f·v"):
        first_step(Reach("panda_tcp", slope_factor=1.1, rate_factor=1.1))


def test_a_wrong_weight_is_named() -> None:
    field = hsp.JointCentering()
    first_step(Swell(WRONG["right"]) * field)
    words = r"weight of cost 'joint_centering': Swell.sample is wrong: w' = "
    with pytest.raises(RateError, match=words):
        first_step(Swell(WRONG["of the other sign"]) * field)
    ramp = hsp.fields.Ramp(final=1.0, duration=1.0)
    with pytest.raises(RateError, match=words):
        first_step(ramp * (Swell(WRONG["zero"]) * field))


def test_a_wrong_metric_is_named() -> None:
    first_step(hsp.JointCentering(), metric=Lengthened(1.0))
    words = r"metric: .* Lengthened.evaluate is wrong: W' = .* \(\d, \d\)"
    with pytest.raises(RateError, match=words):
        first_step(hsp.JointCentering(), metric=Lengthened(-1.0))


class Given(hsp.metrics.Metric):
    """W and L as given, at all times."""

    form = VARYING
    make: Callable[[Any], Any]

    def evaluate(self, state: hsp.RobotState, out: Any) -> Any:
        return self.make(out)


def filled(W: Array, L: Array) -> Callable[[Any], Any]:
    """Return a function that writes both."""

    def fill(out: Any) -> Any:
        out.W[:], out.L[:] = W, L
        return out

    return fill


ONE, TILTED = np.eye(7), np.eye(7) + 0.1 * np.eye(7, k=1)
PRODUCT = TILTED @ TILTED.T


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (filled(-ONE, ONE), "Given: W is not L Lᵀ; needs a symmetric positive"),
        (filled(TILTED, ONE), "W is not L Lᵀ"),
        (filled(ONE, 2.0 * ONE), "W is not L Lᵀ"),
        (filled(ONE, -ONE), "W is not L Lᵀ"),
        (filled(np.nan * ONE, ONE), "W is not L Lᵀ"),
        (filled(PRODUCT, TILTED), "Given: L is not a lower triangle"),
        (lambda _: None, "Given.evaluate returns None; needs out, its sample"),
    ],
)
def test_a_metric_that_is_none_is_refused(make: Any, message: str) -> None:
    """The law would be another one, without a word."""
    first_step(hsp.JointCentering(), metric=Given(filled(PRODUCT, cholesky(PRODUCT))))
    with pytest.raises(MetricError, match=message):
        first_step(hsp.JointCentering(), metric=Given(make))


class Damping(VectorField):
    def vector(self, state: hsp.RobotState) -> Array:
        return g(state) - 0.01 * state.v


class Hurry(hsp.Cost):
    def value(self, state: hsp.RobotState) -> float:
        return f(state) * (1.0 + 0.1 * float(state.v[0]))


READS_V: dict[str, Any] = {
    "FunctionField": FunctionField(lambda s: g(s) - 0.01 * s.v),
    "FunctionField with a rate": FunctionField(
        lambda s: g(s) - 0.01 * s.v, rate_function=g_rate
    ),
    "FunctionCost": hsp.FunctionCost(lambda s: f(s) + float(s.q @ s.v)),
    "gradient_function": hsp.FunctionCost(
        f, gradient_function=lambda s: slope(s) + 0.1 * s.v
    ),
    "VectorField": Damping(),
    "Cost": Hurry(),
    "a frame's velocity": FunctionField(
        lambda s: s.frame(s.robot.end_effector).jacobian_dot[0]
    ),
    "StateWeight": StateWeight(lambda s: 1.0 + s.v[0] ** 2) * hsp.JointCentering(),
}


@pytest.mark.parametrize("way", READS_V)
def test_a_field_that_reads_v_is_named(way: str) -> None:
    with pytest.raises(RateError, match="depends on v: at t = 0 s and one q, it is"):
        first_step(READS_V[way])


def edge(s: hsp.RobotState) -> float:
    """Return a cost of C² that begins where the robot starts."""
    return float((np.maximum(s.q - HOME, 0.0) ** 3).sum())


count = 0


def remembers(s: hsp.RobotState) -> Array:
    global count
    count += 1
    return np.full(7, float(count))


def zeros(s: hsp.RobotState) -> Array:
    return np.zeros(7)


QUIET: dict[str, Any] = {
    "the edge of an influence": hsp.FunctionCost(
        edge,
        gradient_function=lambda s: 3.0 * np.maximum(s.q - HOME, 0.0) ** 2,
        rate_function=lambda s: 6.0 * np.maximum(s.q - HOME, 0.0) * s.v,
    ),
    "a kink": FunctionField(
        lambda s: np.maximum(s.q - HOME, 0.0),
        rate_function=lambda s: np.where(s.q > HOME, s.v, 0.0),
    ),
    "a jump at the start": FunctionField(
        lambda s: np.sign(HOME - s.q), rate_function=zeros
    ),
    "jumps elsewhere": FunctionField(
        lambda s: np.floor(20.0 * s.q + 0.5), rate_function=zeros
    ),
    "a jump by differences": FunctionField(lambda s: np.sign(HOME - s.q)),
    "chatter of 1e4 rad/s": FunctionField(
        lambda s: 1e4 * np.sign(HOME - s.q), rate_function=zeros
    ),
    "a jump in time": FunctionField(
        lambda s: np.ones(7) * (s.t > 1e-4), rate_function=zeros
    ),
    "single precision": FunctionField(
        lambda s: g(s).astype(np.float32), rate_function=g_rate
    ),
    "noise": FunctionField(
        lambda s: g(s) + 1e-3 * np.random.default_rng().normal(size=7),
        rate_function=g_rate,
    ),
    "memory": FunctionField(remembers, rate_function=zeros),
    "not before it begins": FunctionField(
        lambda s: np.full(7, np.sqrt(s.t)) if s.t > 0.0 else np.full(7, s.t + 0.0),
        rate_function=lambda s: np.full(7, 0.5 / np.sqrt(max(s.t, 1e-9))),
    ),
    "a constant": FunctionField(lambda s: np.full(7, 5.0), rate_function=zeros),
    "a large constant": FunctionField(lambda s: 1e4 + g(s), rate_function=g_rate),
    "a stiff one": FunctionField(
        lambda s: np.sin(300.0 * s.q),
        rate_function=lambda s: 300.0 * np.cos(300.0 * s.q) * s.v,
    ),
    "a large offset": hsp.FunctionCost(
        lambda s: 1e3 + f(s), gradient_function=slope, rate_function=slope_rate
    ),
    "a differenced gradient": hsp.FunctionCost(
        lambda s: 1e3 + f(s), rate_function=slope_rate
    ),
    "StateWeight": StateWeight(lambda s: 1.0 + s.q[0] ** 2) * hsp.JointCentering(),
}


@pytest.mark.parametrize("variant", QUIET)
def test_a_right_or_undefined_rate_is_not_named(variant: str) -> None:
    first_step(QUIET[variant])


def test_it_is_checked_once_and_on_a_separate_state() -> None:
    seen: list[tuple[float, Any]] = []

    def watched(s: hsp.RobotState) -> Array:
        seen.append((s.t, s.v.copy()))
        return g(s)

    field = FunctionField(watched, rate_function=g_rate)
    one, plain = controller(field), controller(FunctionField(g, rate_function=g_rate))
    v = 0.1 * np.arange(7.0)
    for each in (one, plain):
        each.restart(origin=0.0)
    efforts = [one.compute(1.0 + 0.001 * k, HOME, v).tau.copy() for k in range(3)]
    for k, effort in enumerate(efforts):
        np.testing.assert_array_equal(
            effort, plain.compute(1.0 + 0.001 * k, HOME, v).tau
        )
    assert sum(not np.array_equal(each, v) for _, each in seen) == 7
    # user code is not called before the run begins
    assert min(t for t, _ in seen) == 1.0
    np.testing.assert_array_equal(one.state.q, HOME)


def test_a_wrong_field_that_comes_later_is_refused_when_it_comes() -> None:
    wrong = FunctionField(g, rate_function=lambda s: -g_rate(s), name="late")
    one = controller(hsp.JointCentering())
    before = one.compute(0.0, HOME, np.zeros(7)).tau.copy()
    with pytest.raises(RateError, match=r"^field 'late': rate_function is wrong"):
        one.at(1.0).field(wrong)
    assert one.changes == ()
    np.testing.assert_array_equal(one.compute(0.0, HOME, np.zeros(7)).tau, before)
    planned = controller(hsp.JointCentering())
    planned.at(1.0).field(wrong)  # the start is not known yet
    with pytest.raises(RateError, match="field 'late'"):
        planned.compute(0.0, HOME, np.zeros(7))


LEANING = """\
import numpy as np
import hsp_control as hsp

class Lean(hsp.Cost, type="leaning_cost_of_a_test"):
    '''It leans.'''

    def value(self, state):
        return state.q[3] ** 2

    def gradient_rate(self, state):
        return -2.0 * state.v[3] * np.eye(7)[3]
"""
CONFIG = """\
robot: {name: panda}
tasks: {hand: {type: frame_position}}
null_space:
  fields:
    - {type: joint_centering}
    - {type: leaning_cost_of_a_test}
"""


def test_errors_of_a_configuration_have_the_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imported, "_functions", {})
    costs, config = tmp_path / "leaning_cost_of_a_test.py", tmp_path / "leaning.yaml"
    costs.write_text(LEANING)
    config.write_text(CONFIG)
    words = r"leaning\.yaml:6: null_space\.fields\.1: cost .*: Lean\.gradient_rate is"
    try:
        imported.import_file(costs)
        with pytest.raises(RateError, match=words):
            hsp.load_experiment(config)
    finally:
        sys.modules.pop(costs.stem, None)
        assert hsp.NullSpaceField.family is not None
        hsp.NullSpaceField.family.members.pop(costs.stem, None)


def test_it_speaks_the_language_of_the_user() -> None:
    field = FunctionField(lambda s: -s.v)
    with pytest.raises(RateError, match=r"Self-motion is damped by null_space_gain$"):
        first_step(field)
    with in_yaml(), pytest.raises(RateError, match=r"by null_space\.gain$"):
        first_step(field)
