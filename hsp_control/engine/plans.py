"""Plans: the calls of parts, bound once, and what supplies their arguments.

A part says its mathematics as a kind of call with its arguments, a `PartCall`. An
argument may be something that has to be brought up to date first: the kinematics of a
frame, a trajectory, what another call writes. Its method ``supplied`` returns what is
read, and the calls that write it. `planned` makes a plan of it all.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.engine import Kind, Plan, PythonCall

PartCall = tuple[Callable[..., Any], tuple[Any, ...]]
"""A kind of the engine, or a function, with its first arguments: what a part's
mathematics is. Who calls it adds the others; `planned` says what may be among them."""

TIME = object()
"""The last argument of a call that brings a reference up to a time [s]."""


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
    """Calls that are made if ``found[1]`` is not zero.

    Their result is ``found[0]``, and what the last of them returns if they are made.
    """

    calls: "PartCalls"
    found: Array  # shape (2,)


AnyCall = PartCall | Once | OnlyIf
PartCalls = Sequence[AnyCall]
"""What a part does in each step: its calls with all their arguments, in this order."""


class CallOutput(NamedTuple):
    """An argument of a call: what another call writes into its last argument."""

    call: PartCall
    out: Any


def with_outputs(call: PartCall, *others: Any) -> PartCall:
    """Return a call with further arguments after its own."""
    function, arguments = call
    return function, (*arguments, *others)


def says(part: object, *ways: str) -> str:
    """Return by which of several methods a part's class says its mathematics.

    It is the one of the most derived class, so that whoever derives from a part of the
    package may override any of them; the first, if one class has several.
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
    if isinstance(call, Once | OnlyIf):
        follow, write = planned(call.calls)
        kind = engine.Once if isinstance(call, Once) else engine.OnlyIf
        return StepPlan(follow, (kind(Plan(write), *call[1:]),))
    function, arguments = call
    timed = bool(arguments) and arguments[-1] is TIME
    given, (follow, write) = supplied(arguments[:-1] if timed else arguments)
    own = bind(function, *given, timed=timed)
    if timed:
        return StepPlan((*follow, own), write)
    return StepPlan(follow, (*write, own))


def supplied(argument: Any) -> tuple[Any, StepPlan]:
    """Return an argument as a call reads it, and the plan of what writes it."""
    if type(argument) is CallOutput:
        return argument.out, planned([with_outputs(*argument)])
    if hasattr(argument, "supplied"):
        value, calls = argument.supplied()
        return value, planned(calls)
    if type(argument) is not tuple:
        return argument, StepPlan()
    parts = [supplied(each) for each in argument]
    follow = tuple(call for _, plan in parts for call in plan.follow)
    write = tuple(call for _, plan in parts for call in plan.write)
    return tuple(value for value, _ in parts), StepPlan(follow, write)


def bind(function: Callable[..., Any], *arguments: Any, timed: bool = False) -> Step:
    """Return a call with these arguments, as a plan makes it.

    Args:
        function: A kind of the engine, or a function.
        arguments: Arrays, numbers, and tuples or records of them. The call reads and
            writes the memory of these arrays each time; numbers are constants.
        timed: Whether it has one more argument, the time, given to the call.
    """
    if isinstance(function, Kind):
        return function(*arguments)
    if not arguments and not timed and hasattr(function, "row"):
        return function
    return PythonCall(partial(function, *arguments) if arguments else function, timed)
