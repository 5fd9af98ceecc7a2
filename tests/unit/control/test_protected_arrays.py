"""Users get copies, not a step's arrays: mistakes raise exact errors or are
harmless."""

import copy
import os
import pickle
import signal
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    ControllerError,
    ImmutableError,
    ModelError,
    ShapeError,
    TaskError,
)
from hsp_control.constraints.limits.barriers import Barrier
from hsp_control.control.step_lock import StepLock
from hsp_control.law import FieldSample, MetricSample, TaskSample
from hsp_control.null_space.fields import (
    FunctionCost,
    FunctionField,
    NullSpaceField,
    StateWeight,
)
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.feedback import ErrorPart, Feedback
from hsp_control.trajectories import HoldOrientation, HoldPose

FRAME = "panda_tcp"
NV = 7

ATTACKS: dict[str, Callable[[RobotState], object]] = {
    "q": lambda s: np.subtract(s.q, 0.1, out=s.q),
    "v": lambda s: s.v.fill(1.0),
    "another q": lambda s: setattr(s, "q", np.zeros(NV)),
    "another v": lambda s: setattr(s, "v", np.zeros(NV)),
    "another t": lambda s: setattr(s, "t", 3.0),
    "update": lambda s: s.update(0.0, np.zeros(NV), np.zeros(NV)),
    "jacobian": lambda s: s.frame(FRAME).jacobian.fill(0.0),
    "its rate": lambda s: s.frame(FRAME).jacobian_dot.fill(0.0),
    "position": lambda s: s.position(FRAME).fill(0.0),
    "rotation": lambda s: s.frame(FRAME).rotation.fill(0.0),
    "velocity": lambda s: s.frame(FRAME).velocity.fill(0.0),
    "another jacobian": lambda s: setattr(
        s.frame(FRAME), "jacobian", np.zeros((6, NV))
    ),
    "motion": lambda s: s.frame(FRAME).motion.jacobian.fill(0.0),
    "M": lambda s: s.mass_matrix.fill(0.0),
    "M'": lambda s: s.mass_matrix_rate.fill(0.0),
    "N": lambda s: s.nonlinear_effects.fill(0.0),
    "centre": lambda s: s.centroidal.jacobian.fill(0.0),
    "companion": lambda s: s.ahead(0.01).q.fill(0.0),
}
"""Attempts of user code to write the state that it receives."""


class Attacked:
    """Which attacks succeeded, and from where."""

    def __init__(self) -> None:
        self.places = set[str]()
        self.done: list[str] = []

    def by(self, place: str, state: RobotState) -> None:
        self.places.add(place)
        for name, attack in ATTACKS.items():
            try:
                attack(state)
            except (ValueError, ImmutableError):
                continue
            self.done.append(f"{place}: {name}")
        # its own copies: Pinocchio's data, and an effort
        state.data.M[:] = state.data.J[:] = state.data.tau[:] = 0.0
        state.inverse_dynamics(np.ones(NV)).fill(0.0)


attacked = Attacked()


class OwnCost(hsp.Cost):
    """A cost that defines all of its methods."""

    def value(self, state: RobotState) -> float:
        attacked.by("Cost.value", state)
        return 0.5 * float(state.q @ state.q)

    def gradient(self, state: RobotState) -> Array:
        attacked.by("Cost.gradient", state)
        return state.q.copy()

    def gradient_rate(self, state: RobotState) -> Array:
        attacked.by("Cost.gradient_rate", state)
        return state.v.copy()


class OwnDerivatives(hsp.Cost):
    """A cost that writes both derivatives."""

    def value(self, state: RobotState) -> float:
        return 0.5 * float(state.q @ state.q)

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        attacked.by("Cost.differentiate", state)
        gradient[:], rate[:] = state.q, state.v


class OwnValue(hsp.Cost):
    """A cost whose derivatives are differences."""

    def value(self, state: RobotState) -> float:
        attacked.by("value for differences", state)
        return 0.5 * float(state.q @ state.q)


class OwnField(NullSpaceField):
    """A field in plain Python."""

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        attacked.by("NullSpaceField.evaluate", state)
        out.g[:], out.g_dot[:] = -state.q, -state.v
        return out

    def value(self, state: RobotState) -> float:
        attacked.by("NullSpaceField.value", state)
        return 0.0


class OwnMetric(Metric):
    """A metric in plain Python."""

    form = 2

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        attacked.by("Metric.evaluate", state)
        out.W[:] = (1.0 + state.q[1] ** 2) * np.eye(NV)
        out.L[:] = np.sqrt(1.0 + state.q[1] ** 2) * np.eye(NV)
        out.W_dot[:] = 2.0 * state.q[1] * state.v[1] * np.eye(NV)
        return out


class OwnTask(Task):
    """The first joint goes to zero."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        return (ErrorPart("angle", "rad", "rad/s", 1),)

    def feedback(self) -> Feedback:
        return Feedback(np.eye(1), 2.0 * np.eye(1), np.zeros(1), np.zeros((0, 3)))

    def evaluate(
        self,
        state: RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        out, feedback = self.given(state, out, feedback)
        attacked.by("Task.evaluate", state)
        out.jacobian[:] = 0.0
        out.jacobian[0, 0] = 1.0
        out.jacobian_dot[:] = 0.0
        out.error[:], out.error_rate[:] = -state.q[:1], -state.v[:1]
        out.acceleration[:] = -state.q[:1] - 2.0 * state.v[:1]
        return out

    def reference_rate(self, state: RobotState) -> Array:
        attacked.by("Task.reference_rate", state)
        return np.zeros(1)

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        attacked.by("Task.measure", state)
        return np.zeros(1), state.q[:1]


class OwnBarrier(Barrier):
    """The second joint stays above -1."""

    def values(self, state: RobotState) -> float:
        attacked.by("Barrier.values", state)
        return float(state.q[1] + 1.0)

    def gradients(self, state: RobotState) -> Array:
        attacked.by("Barrier.gradients", state)
        return np.eye(NV)[1:2]


def of_function(place: str) -> Callable[[RobotState], Any]:
    def function(state: RobotState) -> Any:
        attacked.by(place, state)
        if "rate" in place:
            return state.v.copy()
        if "field" in place or "gradient" in place:
            return state.q.copy()
        return 1.0 if "Weight" in place else 0.5 * float(state.q @ state.q)

    return function


def controllers() -> list[hsp.Controller]:
    """Return controllers that together have every hook in plain Python."""
    panda = hsp.Robot.load("panda")
    hand = hsp.FramePosition(FRAME, hsp.Hold([0.5, 0.1, 0.5]))
    cost = FunctionCost(
        of_function("FunctionCost.function"),
        gradient_function=of_function("FunctionCost.gradient"),
        rate_function=of_function("FunctionCost.rate"),
    )
    vector = FunctionField(
        of_function("FunctionField.field"), rate_function=of_function("field rate")
    )
    weight = StateWeight(of_function("StateWeight"))
    fields = [
        OwnCost(), OwnDerivatives(), OwnValue(), OwnField(), cost, vector,
        hsp.JointCentering(weight=weight),
    ]  # fmt: skip
    limits = hsp.Limits(barriers=[OwnBarrier()])
    return [
        hsp.Controller(panda, [OwnTask(), hand], fields[0], metric=OwnMetric()),
        hsp.Controller(panda, [hand], fields[1], limits=limits),
        *(hsp.Controller(panda, [hand], field, limits=None) for field in fields[2:]),
    ]


@pytest.mark.parametrize(("returned", "message"), [
    (None, "modifier returned NoneType; needs"),
    (np.zeros(NV), "modifier returned ndarray; needs"),
    ((np.zeros(3), None), r"the modifier's acceleration has shape \(3,\); panda needs"),
    ((np.zeros(NV), 1.0), r"the modifier's effort has shape \(\); panda needs"),
    ((np.full(NV, np.nan), None), r"the modifier's acceleration\[0\] is nan"),
])  # fmt: skip
def test_a_modifier_that_returns_something_else(returned: Any, message: str) -> None:
    panda = hsp.Robot.load("panda")
    controller = hsp.Controller(panda, [hsp.FramePosition("panda_tcp")])
    with pytest.raises(hsp.HspControlError, match=message):
        controller.compute(
            0.0, panda.home(), np.zeros(NV), modifier=lambda *_: returned
        )


def test_no_hook_can_change_the_controllers_robot() -> None:
    """Writes are refused or go to a copy; the efforts are the same."""

    def modifier(state: RobotState, active: Any, a: Array) -> tuple[Array, None]:
        attacked.by("modifier", state)
        return a, None

    q, v = hsp.Robot.load("panda").home(), np.full(NV, 0.1)
    for controller in controllers():
        for k in range(2):
            out = controller.compute(0.01 * k, q, v)
            again = controller.compute(0.01 * k, q, v, modifier=modifier)
            np.testing.assert_allclose(out.tau, again.tau, rtol=0, atol=1e-9)
            np.testing.assert_array_equal(controller.state.q, q)
        hsp.simulate(controller, q, duration=0.02, control_period=0.01)
        controller.flow(0.0, q)
    assert attacked.done == []
    assert attacked.places >= {
        "Cost.gradient", "Cost.gradient_rate", "Cost.value", "Cost.differentiate",
        "value for differences", "NullSpaceField.evaluate", "NullSpaceField.value",
        "Metric.evaluate", "Task.evaluate", "Task.reference_rate", "Task.measure",
        "Barrier.values", "Barrier.gradients", "FunctionCost.function",
        "FunctionCost.gradient", "FunctionCost.rate", "FunctionField.field",
        "field rate", "StateWeight", "modifier",
    }  # fmt: skip


# -- the stack that a modifier gets ----------------------------------------------------


def overwrite(shown: Any, seen: dict[int, Any], name: str = "active") -> set[str]:
    """Write into all arrays that public attributes reach; return their names."""
    if (
        shown is None
        or isinstance(shown, str | int | float | type)
        or id(shown) in seen
    ):
        return set()
    seen[id(shown)] = shown  # kept, since ids of freed objects are reused
    if isinstance(shown, np.ndarray):
        with suppress(ValueError):  # read-only
            shown[...] = 7
        return {name}
    if isinstance(shown, Mapping):
        inner = list(shown.items())
    elif type(shown) in (tuple, list):
        inner = list(enumerate(shown))
    elif callable(shown):
        return set()
    else:
        inner = []
        for each in dir(getattr(shown, "_own", shown)):
            if not each.startswith("_"):
                with suppress(ImmutableError, AttributeError):
                    inner.append((each, getattr(shown, each)))
    every = (overwrite(each, seen, f"{name}.{key}") for key, each in inner)
    return set[str]().union(*every)


def test_a_modifier_cannot_write_the_stack() -> None:
    """Nor are bound objects: gains, their changes, contacts, tasks, the field."""
    panda = hsp.Robot.load("panda")
    press = hsp.contacts.CommandedForce([0.0, 0.0, 10.0])
    wipe = hsp.contacts.SlidingContact(FRAME, friction=0.3, force=press)
    hand = hsp.FramePosition(FRAME, hsp.Circle(radius=0.1, angular_rate=2.0))

    def two(modifier: Any) -> list[Array]:
        made = hsp.Controller(
            panda, [hand], hsp.JointCentering(), contacts=[wipe], limits=None
        )
        made.at(0.0).ramp(1.0).gains(hand.name, hsp.Gains(natural_frequency=20.0))
        q, v = panda.home(), np.full(NV, 0.1)
        return [
            made.compute(0.01 * k, q, v, modifier=modifier).tau.copy() for k in range(3)
        ]

    names = set[str]()

    def modifier(state: RobotState, active: Any, a: Array) -> tuple[Array, None]:
        names.update(overwrite(active, {}))
        kept = a.copy()
        a[:] = 7.0  # its own
        return kept, None

    expected = two(lambda state, active, a: (a, None))
    np.testing.assert_array_equal(two(modifier), expected)
    assert names >= {
        "active.rows.jacobian", "active.acceleration", "active.law.problem.gain",
        "active.law.problem.metric.W", "active.support.map", "active.support.forces",
        "active.stacked.0.in_force.numbers", "active.stacked.0.planned.gains.initial",
        "active.stacked.0.planned.gains.transitions.0.target", "active.memory",
    }  # fmt: skip


@pytest.mark.parametrize("by", ["a modifier", "the controller"])
def test_the_active_stack_cannot_be_stepped(by: str) -> None:
    panda = hsp.Robot.load("panda")
    own = hsp.Controller(panda, [hsp.FramePosition(FRAME)])
    q, v = panda.home(), np.zeros(NV)

    def does(attack: Callable[[Any], Any]) -> None:
        def modifier(state: RobotState, active: Any, a: Array) -> tuple[Array, None]:
            attack(active)
            return a, None

        own.compute(0.0, q, v, modifier=modifier if by == "a modifier" else None)
        if by == "the controller":
            attack(own.active_stack)

    with pytest.raises(ValueError, match="read-only"):
        does(lambda active: active.law.problem.gain.fill(0.0))
    with pytest.raises(
        ImmutableError, match=r"active.share cannot be assigned: it is its"
    ):
        does(lambda active: setattr(active, "share", 0.5))
    with pytest.raises(
        ImmutableError, match=r"active.law.call would change .*stack_at"
    ):
        does(lambda active: active.law.call(v))
    does(lambda active: (active.flow(), active.diagnose(), active.field_value()))


# -- the model and Pinocchio's data ----------------------------------------------------


def controller() -> hsp.Controller:
    panda = hsp.Robot.load("panda")
    hand = hsp.FramePosition(FRAME, hsp.Hold([0.5, 0.1, 0.5]))
    return hsp.Controller(panda, [hand], hsp.JointCentering())


def test_a_robots_model_gets_no_more_joints() -> None:
    """Otherwise Pinocchio would write beyond data made for the previous model."""
    own = controller()
    robot = own.robot
    before = own.compute(0.0, robot.home(), np.zeros(NV)).tau.copy()
    joint = pin.JointModelRX(), pin.SE3.Identity(), "more"
    with pytest.raises(
        ModelError, match=r"joints cannot be added.*model = robot.model.copy"
    ):
        robot.model.addJoint(0, *joint)
    np.testing.assert_array_equal(
        own.compute(0.0, robot.home(), np.zeros(NV)).tau, before
    )
    model = robot.model.copy()
    index = model.addJoint(model.njoints - 1, *joint)
    model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
    assert hsp.Robot.from_pinocchio(model).nv == NV + 1


def test_data_that_are_written_or_replaced_change_nothing() -> None:
    own = controller()
    q, v = own.robot.home(), np.full(NV, 0.2)
    before = own.compute(0.0, q, v).tau.copy()
    state = own.robot.state(0.0, q, v)
    for shown in (own.state, state):
        data = shown.data
        for name in ("J", "dJ", "Ag"):
            setattr(data, name, np.zeros((6, 2)))
        data.M, data.C = np.zeros((2, 2)), np.zeros((2, 2))
        for name in ("tau", "nle", "ddq"):
            setattr(data, name, np.zeros(2))
        for place in data.oMi:
            place.translation = np.ones(3)
    np.testing.assert_array_equal(own.compute(0.0, q, v).tau, before)
    fresh = own.robot.state(0.1, q + 0.1, v)
    state.update(0.1, q + 0.1, v)
    np.testing.assert_array_equal(state.mass_matrix, fresh.mass_matrix)
    np.testing.assert_array_equal(state.data.J, fresh.data.J)
    np.testing.assert_array_equal(state.data.oMi[7].homogeneous, fresh.data.oMi[7])


@pytest.mark.parametrize("name", ["q", "v", "t", "time", "robot", "effort"])
def test_arrays_of_a_state_cannot_be_replaced(name: str) -> None:
    """A replaced term would have no effect; values are copied by `update`."""
    robot = hsp.Robot.load("panda")
    state = robot.state(0.0, robot.home(), np.zeros(NV))
    for each in (state, state.seen, state.read_only):
        with pytest.raises(
            ImmutableError, match=f"state.{name} cannot be assigned.*up"
        ):
            setattr(each, name, np.zeros(NV))


def test_arrays_of_a_frame_cannot_be_replaced() -> None:
    own = controller()
    own.compute(0.0, own.robot.home(), np.zeros(NV))
    for name in ("jacobian", "jacobian_dot", "position", "rotation", "motion"):
        with pytest.raises(ImmutableError, match=f"frame.{name} cannot be assigned"):
            setattr(own.state.frame(FRAME), name, np.zeros((6, NV)))


def test_no_array_that_a_hook_reaches_can_be_written() -> None:
    own = controller()
    own.compute(0.0, own.robot.home(), np.full(NV, 0.1))
    shown = own.state.read_only
    reached = {name: getattr(shown, name) for name in dir(shown) if name[0] != "_"}
    reached |= shown.world._asdict() | {"frame.jacobian": shown.frame(FRAME).jacobian}
    arrays = {n: each for n, each in reached.items() if isinstance(each, np.ndarray)}
    assert {"q", "v", "mass_matrix", "placements", "jacobian_dot"} <= arrays.keys()
    written = [name for name, each in arrays.items() if each.flags.writeable]
    # By its identity calls share what they compute; writing it, they compute again.
    assert written == ["stamp_array"]


# -- out= ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sample", "needs"),
    [
        (hsp.Hold([1.0, 2.0, 3.0]).sample, r"TrajectorySample.allocate\(3\)"),
        (HoldOrientation([0.0, 0.0, 0.0]).sample, r"OrientationSample.allocate\(\)"),
        (HoldPose([0.0] * 3, [0.0] * 3).sample, r"PoseSample.allocate\(\)"),
    ],
)
def test_a_sample_of_another_kind_is_one_error(
    sample: Callable[..., object], needs: str
) -> None:
    with pytest.raises(ShapeError, match=f"out is an int; needs {needs}"):
        sample(0.0, 3)


def test_a_sample_of_another_size_is_one_error() -> None:
    own = controller()
    q, v = own.robot.home(), np.zeros(NV)
    own.compute(0.0, q, v)
    task = own.tasks[0]
    for wrong in (np.zeros(3), TaskSample.allocate(2, NV), TaskSample.allocate(3, 3)):
        with pytest.raises(
            TaskError, match=r"out is .*needs TaskSample.allocate\(3, 7"
        ):
            task.evaluate(own.state, wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "metric",
    [
        hsp.metrics.IdentityMetric(),
        hsp.metrics.ConstantMetric(np.ones(NV)),
        hsp.metrics.MassMatrixMetric(),
    ],
)
def test_the_output_of_another_kind_is_named(metric: Metric) -> None:
    """Of metrics, and of fields; the identity would accept anything."""
    robot, fits = hsp.Robot.load("panda"), r"allocate\(7\)"
    state = robot.state(0.0, robot.home(), np.zeros(NV))
    fields = hsp.JointCentering(), hsp.Rest(), hsp.JointCentering() + hsp.Rest()
    known, out = MetricSample.allocate(NV), FieldSample.allocate(NV)
    wrong: Any
    for wrong in (None, "out", np.eye(NV), FieldSample.allocate(NV + 1)):
        with pytest.raises(ShapeError, match=f"out is .*needs MetricSample.{fits}"):
            metric.evaluate(state, wrong)
        for field in fields:
            with pytest.raises(ShapeError, match=f"out is .*needs FieldSample.{fits}"):
                field.evaluate(state, known, metric.form, wrong)
    with pytest.raises(ShapeError, match="metric is ndarray"):
        fields[0].evaluate(state, np.eye(NV), metric.form, out)  # type: ignore[arg-type]


# -- a fork beside a thread ------------------------------------------------------------


def holds_in_a_fork(look: Callable[[], bool]) -> bool:
    """Return what a forked process finds; False also if it waits for ever."""
    child = os.fork()
    if child == 0:  # without pytest's own handlers
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(60)
        code = 1
        try:
            code = 0 if look() else 2
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes that fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_fork_while_a_thread_computes_is_one_error() -> None:
    """The child inherits an unfinished step: it raises instead of waiting for the
    lock."""
    inside, leave = threading.Event(), threading.Event()

    def slow(state: RobotState) -> float:
        inside.set()
        leave.wait(60.0)
        return float(state.q @ state.q)

    panda = hsp.Robot.load("panda")
    hand = hsp.FramePosition(FRAME, hsp.Hold([0.5, 0.1, 0.5]))
    leave.set()
    own = hsp.Controller(panda, [hand], FunctionCost(slow))
    other = controller()
    q, v = panda.home(), np.zeros(NV)
    for each in (own, other):
        each.compute(0.0, q, v)
    inside.clear()
    leave.clear()
    thread = threading.Thread(target=own.compute, args=(0.0, q, v))
    thread.start()
    assert inside.wait(60.0)

    def look() -> bool:
        other.compute(0.0, q, v)  # no step was under way
        try:
            own.compute(0.0, q, v)
        except ControllerError as error:
            return "was forked while another thread" in str(error)
        return False

    held = holds_in_a_fork(look)
    leave.set()
    thread.join()
    assert held
    own.compute(0.0, q, v)  # the parent is unaffected


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_results_of_a_step_are_not_copied(copied: Callable[[object], object]) -> None:
    """A stack belongs to its controller; `stack_at` returns an independent one."""
    made = hsp.Controller(hsp.Robot.load("panda"), [hsp.FramePosition(name="hand")])
    made.compute(0.0, made.robot.home(), np.zeros(NV))
    with pytest.raises(ImmutableError, match=r"active cannot be copied.*stack_at"):
        copied(made.active_stack)


class Slow:
    """An object with a cached property that takes its time."""

    inside, leave = threading.Event(), threading.Event()

    def __init__(self, quick: bool) -> None:
        self.quick = quick

    @cached_property
    def number(self) -> int:
        if not self.quick:
            self.inside.set()
            self.leave.wait(60.0)
        return 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes that fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_fork_while_a_thread_caches_a_property_leaves_no_lock() -> None:
    """Python 3.11 has one lock for all objects of a class: a child waited for ever."""
    thread = threading.Thread(target=lambda: Slow(quick=False).number)
    thread.start()
    assert Slow.inside.wait(60.0)
    held = holds_in_a_fork(lambda: Slow(quick=True).number == 3)
    Slow.leave.set()
    thread.join()
    assert held


def test_a_lock_that_is_held_around_a_step_is_free_in_a_forked_process() -> None:
    """Its holder's thread is gone; it was in no step, so that nothing is half done."""
    lock, held, leave = StepLock(), threading.Event(), threading.Event()

    def hold() -> None:
        with lock._lock:  # as between its acquisition and the beginning of a step
            held.set()
            leave.wait(60.0)

    thread = threading.Thread(target=hold)
    thread.start()
    assert held.wait(60.0)
    lock.forked()
    free = lock._lock.acquire(blocking=False)
    leave.set()
    thread.join()
    assert free
    lock._lock.release()
    with lock:
        pass


def test_a_lock_that_this_thread_holds_is_kept_in_a_forked_process() -> None:
    lock = StepLock()
    with lock:
        lock.forked()
        with pytest.raises(ControllerError, match="calls the same controller"), lock:
            pass
    with lock:
        pass
