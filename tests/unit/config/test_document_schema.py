"""Check every message of a text that does not follow its schema."""

import re
from collections.abc import Callable
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, Discriminator, Field, Tag
from scenario_document import Circle, Line, Part, Positive, Trajectory, message
from typing_extensions import TypeAliasType
from wording import wording

TASK = "robot: panda\ntasks:\n  hand:\n    frame: hand\n"
"""Four lines; tests append a key of the task."""

INVALID = [
    # keys
    ("robot: panda\nfields:\n- type: manipulability\n  wieght: 1",
     "4: fields.0.wieght: unknown ... 'wieght' ... 'weight'"),
    (TASK + "    trajectory: {type: circle, radius: 1, circle: 3}",
     "5: tasks.hand.trajectory.circle: unknown ... 'circle'"),
    (TASK + "    gains:\n      Kp: 3",
     "6: tasks.hand.gains.Kp: unknown ... 'Kp' ... 'kp'"),
    ("steps: 2", "1: missing ... 'robot'"),
    (TASK + "    trajectory:\n      type: line",
     "5: tasks.hand.trajectory: missing ... 'to'"),
    ("robot: a\nframes: {'tool tip': [0, 0, 0]}",
     "2: frames.'tool tip': ... '^[a-z_.]+$'"),
    # choices
    (TASK + "    trajectory:\n      type: circel\n      radius: 1",
     "6: tasks.hand.trajectory.type: unknown ... 'circel' ... 'circle'"),
    (TASK + "    trajectory: {radius: 3}",
     "5: tasks.hand.trajectory: missing ... 'type'"),
    (TASK + "    trajectory:\n      radius: 3\n      tpye: circle",
     "7: tasks.hand.trajectory.tpye: unknown ... 'tpye' ... 'type'"),
    ("robot: a\nintegrator: RK45", "2: integrator: unknown ... 'RK45' ... 'rk4'"),
    # types
    ("robot: 3", "1: robot: 3 ... text"),
    ("robot: a\nsteps: 1.5", "2: steps: 1.5 ... an integer"),
    ("robot: a\nsteps: true", "2: steps: true ... an integer"),
    ("robot: a\nview: on", "2: view: 'on' ... true"),
    ("robot: a\ntasks:\n- a", "2: tasks: ['a'] ... a mapping"),
    ("robot: a\nfields: {type: centering}",
     "2: fields: {type: 'centering'} ... a list of mappings"),
    (TASK + "    gains: [" + "{a: [[1]]}, " * 20 + "]",
     "5: tasks.hand.gains: [{a: [[...]]}, {a: [[...]]}, ... a mapping of kp"),
    ("robot: a\nframes: {tip: 3}", "2: frames.tip: 3 ... a list of 3 numbers"),
    # numbers
    (TASK + "    gains:\n      kp: -3.0",
     "6: tasks.hand.gains.kp: -3.0 ... greater than 0"),
    ("robot: a\nfields: [{type: manipulability, weight: 1.5}]",
     "2: fields.0.weight: 1.5 ... at most 1"),
    (TASK + "    gains: {kp: [1, -.inf]}",
     "5: tasks.hand.gains.kp.1: -.inf ... finite"),
    # unions: one message, about the alternative that was meant
    (TASK + "    gains: {kp: fast}", "5: tasks.hand.gains.kp: 'fast' ... a number"),
    (TASK + "    gains: {kp: {a: 1}}", "5: tasks.hand.gains.kp: {a: 1} ... a number"),
    (TASK + "    gains:\n      kp: [1,\n        fast]",
     "7: tasks.hand.gains.kp.1: 'fast' ... a number"),
    (TASK + "    gains: {kp: [fast]}", "5: tasks.hand.gains.kp.0: 'fast' ... a number"),
    (TASK + "    gains: {kp: [[1], [2, fast]]}",
     "5: tasks.hand.gains.kp.1.1: 'fast' ... a number"),
    (TASK + "    gains: {kp: [[1], 2]}",
     "5: tasks.hand.gains.kp.1: 2 ... a list of numbers"),
    (TASK + "    gains: {kp: [[[1]]]}", "5: tasks.hand.gains.kp.0.0: [1] ... a number"),
    (TASK + "    damping: critcal", "5: tasks.hand.damping: 'critcal' ... 'critical'"),
    ("robot: a\nfields: [{type: centering, middle: {joint: x}}]",
     "2: fields.0.middle.joint: 'x' ... a number"),
    ("robot: a\nroute: {type: circel}",
     "2: route.type: unknown ... 'circel' ... 'circle'"),
    ("robot: a\nroute:\n- {type: circle, radius: 1}\n- {type: circle, raduis: 1}",
     "4: route.1.raduis: unknown ... 'raduis' ... 'radius'"),
    # lengths
    (TASK + "    trajectory: {type: line, to: [1, 2]}",
     "5: tasks.hand.trajectory.to: [1, 2] ... 2 ... 3"),
    (TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1], [], []]}",
     "5: tasks.hand.trajectory.via: [[1], [], []] ... 3 ... at most 2"),
    (TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1]]}",
     "5: tasks.hand.trajectory.via.0: [1] ... 1 ... 3"),
    ("robot: a\ntasks: {b: {frame: ''}}", "2: tasks.b.frame: '' ... 0 ... at least 1"),
    # our own validators
    (TASK + "    trajectory: {type: line, to: [0, 0, 0]}",
     "5: tasks.hand.trajectory: ... length 0 ... 'to'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), INVALID)
def test_texts_that_do_not_follow_the_schema(text: str, expected: str) -> None:
    assert re.search(wording(f"panda.yaml:{expected}"), message(text))


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
    """Types that the scenario above does not use; pydantic converts where it can."""

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
        ("pair: [1]", "pair: [1] ... 1 ... 2"),
        ("pair: []", "pair: [] ... 0 ... 2"),
        ("pair: [1, 2, 3]", "pair: [1, 2, 3] ... 3 ... 2"),
        ("pair: [1, x]", "pair.1: 'x' ... a number"),
        ("pair: x", "pair: 'x' ... a list of 2 numbers"),
        ("pairs: x", "pairs: 'x' ... a list of lists of 2 numbers"),
        ("rows: [[1]]", "rows.0: [1] ... 1 ... at least 2"),
        ("rows: x", "rows: 'x' ... a matrix"),
        ("number: x", "number: 'x' ... a number"),
        ("count: '-5'", "count: '-5' ... greater than 0"),
        ("count: 7", "count: 7 ... multiple of 5"),
        ("count: x", "count: 'x' ... an integer"),
        ("count: 5.5", "count: 5.5 ... an integer"),
        ("text: 1", "text: 1 ... text"),
        ("flag: maybe", "flag: 'maybe' ... true"),
        ("path: 1", "path: 1 ... a path"),
        ("choice: 3", "choice: unknown ... 3"),
        ("shapes: 1", "shapes: 1 ... a mapping"),
        ("shapes: {type: line}", "shapes: missing ... 'to'"),
        ("colour: rad", "colour: unknown ... 'rad' ... 'red'"),
        ("alias: x", "alias: 'x' ... a number"),
        ("nested: {type: pint}", "nested.type: unknown ... 'pint' ... 'point'"),
        ("nested: {type: circle, radios: 1}",
         "nested.radios: unknown ... 'radios' ... 'radius'"),
        ("chosen: {type: circle, radius: x}", "chosen.radius: 'x' ... number"),
        ("chosen: {type: line}", "chosen: missing ... 'to'"),
        ("chosen: {type: circle, radius: 1, x: 1}", "chosen.x: unknown ... 'x'"),
        ("modes: x", "modes: 'x' ... a list of 'a'"),
        ("modes: [c]", "modes.0: 'c' ... 'a'"),
        ("several: 1", "several: 1 ... a list of matrices"),
        ("bare: 1", "bare: 1 ... a list of values"),
        ("day: tomorrow", "day: 'tomorrow' ... valid date"),
        ("call: 1", "call: 1 ... callable"),
        ("new-name: 10", "new-name: 10 ... less than 10"),
    ],
)  # fmt: skip
def test_lenient_models(text: str, expected: str) -> None:
    assert re.search(wording(f"panda.yaml:1: {expected}"), message(text, model=Lenient))


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
    first, more, *lines, last = message(SEVERAL).splitlines()
    assert (more, last) == ("and 7 more:", "  ... (2 not shown)")
    expected = (
        "panda.yaml:1: integrator: ... 'rk5' ... 'rk4'",
        "panda.yaml:2: stepz: ... 'steps'",
        "panda.yaml:3: robot: 7 ... text",
        "panda.yaml:5: fields.0.weight: 'a' ... number",
        "panda.yaml:5: fields.0.middel: ... 'middle'",
        "panda.yaml:6: fields.1.weight: 'b' ... number",
    )
    for reported, line in zip(expected, [first, *lines], strict=True):
        assert re.search(wording(reported), line.strip())
