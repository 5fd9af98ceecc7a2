"""Values as functions of time."""

from bisect import insort
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.null_space.fields.weight import Weight
from hsp_control.robot import RobotState
from hsp_control.trajectories.schedule import smooth_step

Value = TypeVar("Value", float, Array)


@dataclass(frozen=True)
class Transition(Generic[Value]):
    """A smooth change to a value."""

    start: float  # when it begins [s]
    ramp: float  # its duration [s]; 0 is a jump
    target: Value  # new value

    @property
    def end(self) -> float:
        """End time [s]."""
        return self.start + self.ramp

    def share(self, t: float) -> tuple[float, float, float]:
        """Return s(t) from 0 to 1, s' [1/s] and s'' [1/s²]; C² in t."""
        if self.ramp == 0.0:
            return float(t >= self.start), 0.0, 0.0
        return smooth_step(t, self.start, self.ramp)


@dataclass(frozen=True)
class Evolution(Generic[Value]):
    """x(t): a value and the transitions that change it, in order of time.

    Transition k crossfades from whatever x would have been without it:

        x_k(t) = x_{k-1}(t) + s_k(t) (target_k - x_{k-1}(t)).

    So a transition that begins while another is under way continues its motion, and x
    is C² however they overlap. x depends on time alone, not on when it is evaluated.
    """

    initial: Value  # value before all transitions
    transitions: tuple[Transition[Value], ...] = ()  # in order of their start

    def then(self, start: float, ramp: float, target: Value) -> "Evolution[Value]":
        """Return the evolution with one more transition."""
        if isinstance(self.initial, np.ndarray):
            target = np.asarray(target, dtype=float)  # a user's may be a list
        ordered = list(self.transitions)
        insort(ordered, Transition(start, ramp, target), key=lambda each: each.start)
        return Evolution(self.initial, tuple(ordered))

    @property
    def constant(self) -> bool:
        """Whether the value never changes."""
        return not self.transitions

    @property
    def end(self) -> float:
        """When the last transition is complete [s]; -inf without one."""
        return max((each.end for each in self.transitions), default=-np.inf)

    @property
    def target(self) -> Value:
        """The value after all transitions."""
        return self.transitions[-1].target if self.transitions else self.initial

    def at(self, t: float) -> Value:
        """Return x(t)."""
        x: Value = self.initial
        for each in self.transitions:
            if each.start > t:
                break
            s = each.share(t)[0]
            if s == 1.0:
                x = each.target
            elif s > 0.0:
                x = x + s * (each.target - x)
        return x

    def with_rate(self, t: float) -> tuple[Value, Value]:
        """Return x(t) and x'(t)."""
        return self.with_rates(t)[:2]

    def with_rates(self, t: float) -> tuple[Value, Value, Value]:
        """Return x(t), x'(t) and x''(t)."""
        x: Value = self.initial
        x_dot: Value = 0.0 * x
        x_ddot = x_dot
        for each in self.transitions:
            if each.start > t:
                break
            s, s_dot, s_ddot = each.share(t)
            if s == 1.0 and s_ddot == 0.0:  # s alone rounds to 1 a little before
                x, x_dot = each.target, 0.0 * each.target
                x_ddot = x_dot
            elif s > 0.0:
                away = each.target - x
                x_ddot = (1.0 - s) * x_ddot - 2.0 * s_dot * x_dot + s_ddot * away
                x_dot = (1.0 - s) * x_dot + s_dot * away
                x = x + s * away
        return x, x_dot, x_ddot

    def call(self, x: Array, rate: Array | None = None) -> PartCall:
        """Return the call that writes x(t), and x'(t), at a time.

        Args:
            x: Where it writes the value, which has n numbers.
            rate: Where it writes the rate, likewise; None: it is not kept.
        """
        steps = self.transitions
        targets = [np.ravel(each.target) for each in steps]
        times = [(each.start, each.ramp) for each in steps]
        return PartCall(
            engine.Evolve,
            initial=np.array(self.initial, dtype=float).reshape(-1),
            targets=np.array(targets, dtype=float).reshape(len(steps), x.size),
            times=np.array(times, dtype=float).reshape(len(steps), 2),
            count=np.array([len(steps)]),
            least=-np.inf,
            most=np.inf,
            cone=np.zeros((0, x.size)),
            definite=0,
            x=x.reshape(-1),
            rate=np.zeros(x.size) if rate is None else rate.reshape(-1),
            ramp=np.zeros(1),
            t=TIME,
        )

    def settled(self, t: float) -> "Evolution[Value]":
        """Return the evolution for times from t on: complete transitions are folded."""
        done = [k for k, each in enumerate(self.transitions) if each.end <= t]
        if not done:
            return self
        last = done[-1]
        return Evolution(self.transitions[last].target, self.transitions[last + 1 :])


class EvolvingWeight(Weight):
    """w(t) given by an `Evolution`."""

    evolution: Evolution[float]
    """w(t) [-]."""

    @property
    def constant(self) -> bool:
        """Whether w never changes."""
        return self.evolution.constant

    def calls(self, time: Array) -> tuple[PartCalls, Array]:
        """Return the calls that write w and w'; see `Weight.calls`."""
        del time  # that of the plan
        weight = np.zeros(2)
        return [self.evolution.call(weight[:1], weight[1:])], weight

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        return self.evolution.with_rate(state.t)


PRESENT: Evolution[float] = Evolution(1.0)
"""Weight of a permanent part."""
ABSENT: Evolution[float] = Evolution(0.0)
"""Weight of an absent part; a transition adds it."""
