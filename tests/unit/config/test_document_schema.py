"""Check every message of a text that does not follow its schema."""

from collections.abc import Callable
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, Discriminator, Field, Tag
from scenario_document import Circle, Line, Part, Positive, Trajectory, message
from typing_extensions import TypeAliasType

TASK = "robot: panda\ntasks:\n  hand:\n    frame: hand\n"
"""Four lines, after which a test adds a key to the task."""

INVALID = [
    # keys
    ("robot: panda\nfields:\n- type: manipulability\n  wieght: 1",
     "4: fields.0.wieght: unknown key 'wieght'; did you mean 'weight'? (allowed: "
     "type, weight, reference)"),
    (TASK + "    trajectory: {type: circle, radius: 1, circle: 3}",
     "5: tasks.hand.trajectory.circle: unknown key 'circle' (allowed: type, radius, "
     "center)"),
    (TASK + "    gains:\n      Kp: 3",
     "6: tasks.hand.gains.Kp: unknown key 'Kp'; did you mean 'kp'? (allowed: kp, kd)"),
    ("steps: 2", "1: missing key 'robot'; required here: robot"),
    (TASK + "    trajectory:\n      type: line",
     "5: tasks.hand.trajectory: missing key 'to'; required here: type, to"),
    ("robot: a\nframes: {'tool tip': [0, 0, 0]}",
     "2: frames.'tool tip': the key 'tool tip' should match pattern '^[a-z_.]+$'"),
    # choices
    (TASK + "    trajectory:\n      type: circel\n      radius: 1",
     "6: tasks.hand.trajectory.type: unknown type 'circel'; did you mean 'circle'? "
     "(allowed: circle, line, segment)"),
    (TASK + "    trajectory: {radius: 3}", "5: tasks.hand.trajectory: missing key "
     "'type'; type is one of: circle, line, segment"),
    (TASK + "    trajectory:\n      radius: 3\n      tpye: circle",
     "7: tasks.hand.trajectory.tpye: unknown key 'tpye'; did you mean 'type'? (type "
     "is one of: circle, line, segment)"),
    ("robot: a\nintegrator: RK45",
     "2: integrator: unknown value 'RK45'; did you mean 'rk4'? (allowed: euler, rk4)"),
    # types
    ("robot: 3", "1: robot: 3 is an integer; expected text"),
    ("robot: a\nsteps: 1.5", "2: steps: 1.5 is a decimal number; expected an integer"),
    ("robot: a\nsteps: true", "2: steps: true is a boolean; expected an integer"),
    ("robot: a\nview: on", "2: view: 'on' is text; expected true or false"),
    ("robot: a\ntasks:\n- a", "2: tasks: ['a'] is a list; expected a mapping"),
    ("robot: a\nfields: {type: centering}",
     "2: fields: {type: 'centering'} is a mapping; expected a list of mappings"),
    (TASK + "    gains: [" + "{a: [[1]]}, " * 20 + "]", "5: tasks.hand.gains: [{a: "
     "[[...]]}, {a: [[...]]}, {a: [[..... is a list; expected a mapping of kp, kd"),
    ("robot: a\nframes: {tip: 3}",
     "2: frames.tip: 3 is an integer; expected a list of 3 numbers"),
    # numbers
    (TASK + "    gains:\n      kp: -3.0",
     "6: tasks.hand.gains.kp: -3.0 is negative; must be greater than 0"),
    ("robot: a\nfields: [{type: manipulability, weight: 1.5}]",
     "2: fields.0.weight: 1.5 is too large; must be at most 1"),
    (TASK + "    gains: {kp: [1, -.inf]}",
     "5: tasks.hand.gains.kp.1: -.inf is not a finite number"),
    # unions: one message, about the alternative that was meant
    (TASK + "    gains: {kp: fast}", "5: tasks.hand.gains.kp: 'fast' is text; "
     "expected a number, a list of numbers or a matrix"),
    (TASK + "    gains: {kp: {a: 1}}", "5: tasks.hand.gains.kp: {a: 1} is a mapping; "
     "expected a number, a list of numbers or a matrix"),
    (TASK + "    gains:\n      kp: [1,\n        fast]",
     "7: tasks.hand.gains.kp.1: 'fast' is text; expected a number"),
    (TASK + "    gains: {kp: [fast]}", "5: tasks.hand.gains.kp.0: 'fast' is text; "
     "expected a number or a list of numbers"),
    (TASK + "    gains: {kp: [[1], [2, fast]]}",
     "5: tasks.hand.gains.kp.1.1: 'fast' is text; expected a number"),
    (TASK + "    gains: {kp: [[1], 2]}",
     "5: tasks.hand.gains.kp.1: 2 is an integer; expected a list of numbers"),
    (TASK + "    gains: {kp: [[[1]]]}",
     "5: tasks.hand.gains.kp.0.0: [1] is a list; expected a number"),
    (TASK + "    damping: critcal", "5: tasks.hand.damping: 'critcal' is text; "
     "expected 'critical' or a number; did you mean 'critical'?"),
    ("robot: a\nfields: [{type: centering, middle: {joint: x}}]",
     "2: fields.0.middle.joint: 'x' is text; expected a number"),
    ("robot: a\nroute: {type: circel}", "2: route.type: unknown type 'circel'; did "
     "you mean 'circle'? (allowed: circle, line, segment)"),
    ("robot: a\nroute:\n- {type: circle, radius: 1}\n- {type: circle, raduis: 1}",
     "4: route.1.raduis: unknown key 'raduis'; did you mean 'radius'? (allowed: type, "
     "radius, center)"),
    # lengths
    (TASK + "    trajectory: {type: line, to: [1, 2]}",
     "5: tasks.hand.trajectory.to: [1, 2] has 2 entries, needs 3"),
    (TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1], [], []]}",
     "5: tasks.hand.trajectory.via: [[1], [], []] has 3 entries, needs at most 2"),
    (TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1]]}",
     "5: tasks.hand.trajectory.via.0: [1] has 1 entry, needs 3"),
    ("robot: a\ntasks: {b: {frame: ''}}",
     "2: tasks.b.frame: '' has 0 characters, needs at least 1"),
    # our own validators
    (TASK + "    trajectory: {type: line, to: [0, 0, 0]}",
     "5: tasks.hand.trajectory: a line of length 0; move 'to' away from the origin"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), INVALID)
def test_what_does_not_follow_the_schema(text: str, expected: str) -> None:
    assert message(text) == f"panda.yaml:{expected}"


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


class Point(Part):
    type: Literal["point"]


Alias = TypeAliasType("Alias", Positive | list[Positive])
Nested = Annotated[Trajectory | Point, Field(discriminator="type")]
Chosen = Annotated[
    Annotated[Circle, Tag("round")] | Annotated[Line, Tag("straight")],
    Discriminator(lambda value: "round" if "radius" in value else "straight"),
]


class Lenient(BaseModel):
    """Types that the scenario above does not use, converted where pydantic can."""

    pair: tuple[float, float] = (0.0, 0.0)
    pairs: list[tuple[float, float]] = []
    rows: list[Annotated[list[float], Field(min_length=2)]] = []
    number: float = 0.0
    count: Annotated[int, Field(gt=0, multiple_of=5)] = 5
    text: str = ""
    flag: bool = False
    path: Path = Path()
    anything: Any = None
    choice: Literal[1, 2] = 1
    shapes: Circle | Line | None = None
    colour: Colour = Colour.RED
    alias: Alias = 0.0
    nested: Nested | None = None
    chosen: Chosen | None = None
    modes: list[Literal["a", "b"] | bool] = []
    several: list[list[list[float]]] = []
    bare: list = []  # type: ignore[type-arg]
    day: date | None = None
    call: Callable[[], None] | None = None
    renamed: int = Field(default=0, alias="new-name", lt=10)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("pair: [1]", "pair: [1] has 1 entry, needs 2"),
        ("pair: []", "pair: [] has 0 entries, needs 2"),
        ("pair: [1, 2, 3]", "pair: [1, 2, 3] has 3 entries, needs 2"),
        ("pair: [1, x]", "pair.1: 'x' is text; expected a number"),
        ("pair: x", "pair: 'x' is text; expected a list of 2 numbers"),
        ("pairs: x", "pairs: 'x' is text; expected a list of lists of 2 numbers"),
        ("rows: [[1]]", "rows.0: [1] has 1 entry, needs at least 2"),
        ("rows: x", "rows: 'x' is text; expected a matrix"),
        ("number: x", "number: 'x' is text; expected a number"),
        ("count: '-5'", "count: '-5' is too small; must be greater than 0"),
        ("count: 7", "count: 7 should be a multiple of 5"),
        ("count: x", "count: 'x' is text; expected an integer"),
        ("count: 5.5", "count: 5.5 is a decimal number; expected an integer"),
        ("text: 1", "text: 1 is an integer; expected text"),
        ("flag: maybe", "flag: 'maybe' is text; expected true or false"),
        ("path: 1", "path: 1 is an integer; expected a path"),
        ("choice: 3", "choice: unknown value 3 (allowed: 1, 2)"),
        ("shapes: 1", "shapes: 1 is an integer; expected a mapping"),
        ("shapes: {type: line}", "shapes: missing key 'to'; required here: type, to"),
        ("colour: rad",
         "colour: unknown value 'rad'; did you mean 'red'? (allowed: red, blue)"),
        ("alias: x", "alias: 'x' is text; expected a number or a list of numbers"),
        ("nested: {type: pint}", "nested.type: unknown type 'pint'; did you mean "
         "'point'? (allowed: circle, line, segment, point)"),
        ("nested: {type: circle, radios: 1}", "nested.radios: unknown key 'radios'; "
         "did you mean 'radius'? (allowed: type, radius, center)"),
        ("chosen: {type: circle, radius: x}",
         "chosen.radius: 'x' should be a valid number"),
        ("chosen: {type: line}", "chosen: missing key 'to'"),
        ("chosen: {type: circle, radius: 1, x: 1}", "chosen.x: unknown key 'x'"),
        ("modes: x", "modes: 'x' is text; expected a list of 'a', 'b' or booleans"),
        ("modes: [c]", "modes.0: 'c' is text; expected 'a', 'b' or true or false"),
        ("several: 1", "several: 1 is an integer; expected a list of matrices"),
        ("bare: 1", "bare: 1 is an integer; expected a list of values"),
        ("day: tomorrow",
         "day: 'tomorrow' should be a valid date or datetime, input is too short"),
        ("call: 1", "call: 1 should be callable"),
        ("new-name: 10", "new-name: 10 is too large; must be less than 10"),
    ],
)  # fmt: skip
def test_lenient_models(text: str, expected: str) -> None:
    assert message(text, model=Lenient) == f"panda.yaml:1: {expected}"


SEVERAL = """\
integrator: rk5
stepz: 3
robot: 7
fields:
- {type: centering, weight: a, middel: [1]}
- {type: centering, weight: b}
view: 0
tasks: {hand: {}}
"""


def test_several_mistakes_are_listed_in_the_order_of_the_file() -> None:
    assert message(SEVERAL) == (
        "panda.yaml:1: integrator: unknown value 'rk5'; did you mean 'rk4'? "
        "(allowed: euler, rk4)\n"
        "and 7 more:\n"
        "  panda.yaml:2: stepz: unknown key 'stepz'; did you mean 'steps'? "
        "(allowed: robot, tasks, fields, route, frames, steps, view, integrator)\n"
        "  panda.yaml:3: robot: 7 is an integer; expected text\n"
        "  panda.yaml:5: fields.0.weight: 'a' is text; expected a number\n"
        "  panda.yaml:5: fields.0.middel: unknown key 'middel'; did you mean 'middle'? "
        "(allowed: type, weight, middle)\n"
        "  panda.yaml:6: fields.1.weight: 'b' is text; expected a number\n"
        "  ... (2 not shown)"
    )
