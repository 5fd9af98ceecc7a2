"""Plans: the calls of parts, bound once, and the calls that supply their arguments.

A part defines its mathematics as a kind of call with arguments by name, a `PartCall`.
An argument may be a value that must be updated first: the kinematics of a frame, a
trajectory, the result of another call. Its method ``supplied`` returns the array to
read, and the calls that write it. `planned` combines them into a plan:

    PartCall the call to make, with arguments that may have to be supplied
    Step       a bound call: it has its arrays, and is called with the time
    StepPlan   the steps of part calls, in order: first those of the time alone, so
               that a state may be evaluated after it, then those that read the state
    Plan       steps as one call of the engine
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Indices
from hsp_control.engine import Kind, Plan, PythonCall

TIME = object()
"""The argument ``t`` of a call that brings a reference up to a time [s]."""


class PartCall:
    """A kind of the engine, or a function, with arguments: a part's mathematics.

    Arguments have the names of the kind's members, or of the function's parameters. The
    caller adds the others; `planned` describes the possible values.
    """

    __slots__ = ("arguments", "function")

    def __init__(self, function: Callable[..., Any], /, **arguments: Any) -> None:
        self.function, self.arguments = function, arguments

    def given(self, **others: Any) -> "PartCall":
        """Return the call with further arguments.

        Raises:
            TypeError: If it has one of them.
        """
        return PartCall(self.function, **self.arguments, **others)

    def __repr__(self) -> str:
        kind = self.function
        what = kind.name if isinstance(kind, Kind) else repr(kind)
        return f"PartCall({', '.join([what, *self.arguments])})"


class Once(NamedTuple):
    """Calls that run unless they have run at this stamp."""

    calls: "PartCalls"
    stamp: Indices  # shape (1,)
    made: Indices  # the stamp of their last run, shape (1,)

    @classmethod
    def at(cls, stamp: Indices, *calls: PartCall) -> Self:
        """Return calls that have not run yet."""
        return cls(calls, stamp, np.full(1, -1))


class OnlyIf(NamedTuple):
    """Calls that run if a condition is not 0."""

    calls: "PartCalls"
    condition: Indices  # shape (1,)


AnyCall = PartCall | Once | OnlyIf
PartCalls = Sequence[AnyCall]
"""The calls of a part in every step, with all their arguments, in this order."""


class CallOutput(NamedTuple):
    """An argument of a call: the result of another call in its argument ``out``."""

    call: PartCall
    out: Any


def implemented_by(part: object, *ways: str) -> str:
    """Return which of several methods the most derived class of a part overrides.

    A subclass of a part of the package may override any of them; the result is the
    first, if one class has several.
    """
    for each in type(part).__mro__:
        for way in ways:
            if way in vars(each):
                return way
    raise AttributeError(f"{type(part).__name__} has none of {', '.join(ways)}")


Step = Callable[..., Any]
"""An element of a plan: a call of the engine, or an object that behaves like one."""


class StepPlan(NamedTuple):
    """The calls that evaluate parts of a controller, at the present state."""

    follow: tuple[Step, ...] = ()  # bring references up to the time [s]
    write: tuple[Step, ...] = ()  # read the state, and write the results

    def run(self, t: float) -> float:
        """Run the calls at a time [s]; return the last one's result."""
        return Plan(self.steps())(t)

    def steps(self) -> list[Step]:
        """Return all of the calls, in order."""
        return [*self.follow, *self.write]

    def call(self) -> Plan:
        """Return the writing calls as one call."""
        return Plan(self.write)


def planned(calls: PartCalls) -> StepPlan:
    """Return the plan of calls; one that occurs twice is bound once."""
    plans: dict[int, StepPlan] = {}
    follow: list[Step] = []
    write: list[Step] = []
    for each in calls:
        if id(each) not in plans:
            plans[id(each)] = _plan(each)
            follow += plans[id(each)].follow
        write += plans[id(each)].write
    return StepPlan(tuple(follow), tuple(write))


def _plan(call: AnyCall) -> StepPlan:
    """Return the plan of one call."""
    if isinstance(call, PartCall):
        timed = call.arguments.get("t") is TIME
        follow: list[Step] = []
        write: list[Step] = []
        given = {}
        for name, argument in call.arguments.items():
            if argument is not TIME:
                given[name], plan = supplied(argument)
                follow += plan.follow
                write += plan.write
        (follow if timed else write).append(bind(call.function, given, timed=timed))
        return StepPlan(tuple(follow), tuple(write))
    inner = planned(call.calls)
    if isinstance(call, Once):
        own = engine.Once(calls=inner.call(), stamp=call.stamp, made=call.made)
    else:
        own = engine.OnlyIf(calls=inner.call(), condition=call.condition)
    return StepPlan(inner.follow, (own,))


_NOTHING = StepPlan()


def supplied(argument: Any) -> tuple[Any, StepPlan]:
    """Return an argument as a call reads it, and the plan of its writers."""
    if type(argument) is CallOutput:
        return argument.out, planned([argument.call.given(out=argument.out)])
    if hasattr(argument, "supplied"):
        value, calls = argument.supplied()
        return value, planned(calls)
    if type(argument) is not dict:
        return argument, _NOTHING
    parts = {name: supplied(each) for name, each in argument.items()}
    follow = tuple(call for _, plan in parts.values() for call in plan.follow)
    write = tuple(call for _, plan in parts.values() for call in plan.write)
    values = {name: value for name, (value, _) in parts.items()}
    return values, StepPlan(follow, write)


def bind(
    function: Callable[..., Any], arguments: Mapping[str, Any], *, timed: bool = False
) -> Step:
    """Return a bound call with these arguments.

    Args:
        function: A kind of the engine, or a function.
        arguments: By name: arrays, numbers, and records of them, which are named tuples
            or dicts. The call reads and writes the memory of these arrays every time;
            numbers are constants.
        timed: Whether it also receives the time; a function has it as its first
        parameter.
    """
    if isinstance(function, Kind):
        return function(**arguments)
    if not arguments and not timed and hasattr(function, "row"):
        return function
    return PythonCall(partial(function, **arguments) if arguments else function, timed)
