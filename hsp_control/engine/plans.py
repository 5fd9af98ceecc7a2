"""Plans: the calls of parts, bound once, and what supplies their arguments.

A part says its mathematics as a kind of call with arguments by name, a `PartCall`. An
argument may be something that has to be brought up to date first: the kinematics of a
frame, a trajectory, what another call writes. Its method ``supplied`` returns what is
read, and the calls that write it. `planned` makes a plan of it all:

    PartCall   what is to be called, with arguments that may have to be supplied
    Step       a call that is bound: it has its arrays, and is called with the time
    StepPlan   the steps of part calls, in order: first what follows the time alone, so
               that a state may be evaluated after it, then what reads the state
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

    Arguments have the names of the kind's members, or of the function's parameters.
    Who makes the call adds the others; `planned` says what may be among them.
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
    """Calls that are made unless they were made at this stamp."""

    calls: "PartCalls"
    stamp: Indices  # shape (1,)
    made: Indices  # the stamp at which they were made last, shape (1,)

    @classmethod
    def at(cls, stamp: Indices, *calls: PartCall) -> Self:
        """Return calls that were not made yet."""
        return cls(calls, stamp, np.full(1, -1))


class OnlyIf(NamedTuple):
    """Calls that are made if a condition is not 0."""

    calls: "PartCalls"
    condition: Indices  # shape (1,)


AnyCall = PartCall | Once | OnlyIf
PartCalls = Sequence[AnyCall]
"""What a part does in each step: its calls with all their arguments, in this order."""


class CallOutput(NamedTuple):
    """An argument of a call: what another call writes into its argument ``out``."""

    call: PartCall
    out: Any


def says(part: object, *ways: str) -> str:
    """Return by which of several methods a part's class says its mathematics.

    It is the one of the most derived class, so that a subclass of a part of the package
    may override any of them; the first, if one class has several.
    """
    for each in type(part).__mro__:
        for way in ways:
            if way in vars(each):
                return way
    raise AttributeError(f"{type(part).__name__} has none of {', '.join(ways)}")


Step = Callable[..., Any]
"""What stands in a plan: a call of the engine, or one that it makes as its own."""


class StepPlan(NamedTuple):
    """The calls that evaluate parts of a controller, at whatever the state is."""

    follow: tuple[Step, ...] = ()  # bring references up to the time [s]
    write: tuple[Step, ...] = ()  # read the state, and write the results

    def run(self, t: float) -> float:
        """Make the calls at a time [s]; return what the last one returns."""
        return Plan(self.steps())(t)

    def steps(self) -> list[Step]:
        """Return all of the calls, in order."""
        return [*self.follow, *self.write]

    def call(self) -> Plan:
        """Return what writes, as one call."""
        return Plan(self.write)


def planned(calls: PartCalls) -> StepPlan:
    """Return the plan of calls; one that comes twice is bound once."""
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
    """Return an argument as a call reads it, and the plan of what writes it."""
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
    """Return a call with these arguments, as a plan makes it.

    Args:
        function: A kind of the engine, or a function.
        arguments: By name: arrays, numbers, and records of them, which are named tuples
            or dicts. The call reads and writes the memory of these arrays each time;
            numbers are constants.
        timed: Whether it is also given the time; a function takes it first.
    """
    if isinstance(function, Kind):
        return function(**arguments)
    if not arguments and not timed and hasattr(function, "row"):
        return function
    return PythonCall(partial(function, **arguments) if arguments else function, timed)
