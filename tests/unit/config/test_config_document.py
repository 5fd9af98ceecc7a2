"""Configuration errors are part of the interface: every message is matched exactly."""

import pickle
from collections.abc import Callable
from datetime import date
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    RootModel,
    Tag,
    model_validator,
)
from typing_extensions import TypeAliasType

from hsp_control.common.exceptions import ConfigError, FrameNotFoundError, ShapeError
from hsp_control.common.suggestions import did_you_mean, listing, nearest
from hsp_control.config.document import Document
from hsp_control.config.validation import validate
from hsp_control.config.yaml_reader import MAX_SIZE, MAX_VALUES

pytestmark = pytest.mark.filterwarnings("error")

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    """What all parts of the small schema below share."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Gains(Part):
    kp: Positive | list[Positive] | list[list[Positive]]
    kd: Positive | None = None


class Circle(Part):
    type: Literal["circle"]
    radius: Positive
    center: Vector3 = [0.0, 0.0, 0.0]


class Line(Part):
    type: Literal["line", "segment"]
    to: Vector3
    via: Annotated[list[Vector3], Field(max_length=2)] = []

    @model_validator(mode="after")
    def _moves(self) -> "Line":
        if not any(self.to):
            raise ValueError("a line of length 0; move 'to' away from the origin")
        return self


Trajectory = Annotated[Circle | Line, Field(discriminator="type")]


class Task(Part):
    frame: Annotated[str, Field(min_length=1)]
    trajectory: Trajectory | None = None
    gains: Gains | None = None
    damping: Literal["critical"] | Positive = "critical"


class Manipulability(Part):
    type: Literal["manipulability"]
    weight: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    reference: str | None = None


class Centering(Part):
    type: Literal["centering"]
    weight: float = 1.0
    middle: list[float] | dict[str, float] | None = None


Frames = RootModel[dict[Annotated[str, Field(pattern="^[a-z_.]+$")], Vector3]]


class Scenario(Part):
    robot: str
    tasks: dict[str, Task] = {}
    fields: list[
        Annotated[Manipulability | Centering, Field(discriminator="type")]
    ] = []
    route: Trajectory | list[Trajectory] | None = None
    frames: Frames | None = None
    steps: int = 1
    view: bool = False
    integrator: Literal["euler", "rk4"] = "rk4"


GOOD = """\
robot: panda   # comments do not count
tasks:
  hand:
    frame: panda_hand
    gains: &soft {kp: 1e2, kd: 20}
    trajectory:
      type: circle
      radius: 1e-1
  elbow:
    frame: panda_link4
    gains: *soft
    trajectory: {type: segment, to: [0, .5, -1.]}
fields:
- type: manipulability
  weight: 0.5
- {type: centering, middle: {joint: 1.5}}
frames:
  tool.tip: [0, 0, 0x10]
"""


def read(text: str, *overrides: str, model: type[BaseModel] = Scenario) -> BaseModel:
    """Parse a text, apply the overrides and validate."""
    document = Document.parse(text, "panda.yaml")
    for override in overrides:
        document.override(override)
    return validate(document, model)


def message(text: str, *overrides: str, model: type[BaseModel] = Scenario) -> str:
    """Return the message of the one error that a text leads to."""
    with pytest.raises(ConfigError) as caught:
        read(text, *overrides, model=model)
    return str(caught.value)


# -- what is read ---------------------------------------------------------------------


def test_a_good_text_becomes_the_model() -> None:
    scenario = validate(Document.parse(GOOD), Scenario)
    assert scenario.tasks["hand"].gains == scenario.tasks["elbow"].gains
    assert scenario.tasks["hand"].gains == Gains(kp=100.0, kd=20.0)
    assert isinstance(scenario.tasks["elbow"].trajectory, Line)
    assert scenario.frames is not None
    assert scenario.frames.root == {"tool.tip": [0.0, 0.0, 16.0]}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-1", 0.1),
        ("1e3", 1000.0),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("+.inf", float("inf")),
        ("-.INF", -float("inf")),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("18446744073709551615", 2**64 - 1),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2001-01-01", "2001-01-01"),
        ("on", "on"),
        ("no", "no"),
        ("True", True),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ("!!str 1", "1"),
        ("!!float 1", 1.0),
        ("=", "="),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    read = Document.parse(f"key: {text}").to_dict()["key"]
    assert read == value
    assert type(read) is type(value)


def test_nan_is_read_so_that_the_schema_can_refuse_it() -> None:
    read = Document.parse("key: .nan").to_dict()["key"]
    assert read != read


def test_every_key_path_has_a_location() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    assert document.location(()) == "panda.yaml:1"
    assert (
        document.location(("tasks", "hand", "trajectory", "radius")) == "panda.yaml:8"
    )
    assert document.mark(("fields", 0, "weight")) == (15, 3)
    assert document.mark(("fields", 1, "middle", "joint")) == (16, 30)
    assert document.location(("tasks", "elbow", "gains")) == "panda.yaml:11"
    # Behind an alias, the line to mend is where its anchor stands.
    assert document.location(("tasks", "elbow", "gains", "kp")) == "panda.yaml:5"
    # What is missing is missing in its nearest ancestor.
    assert document.location(("tasks", "hand", "gains", "ki", 3)) == "panda.yaml:5"
    assert document.location(("nothing",)) == "panda.yaml:1"


def test_the_data_are_copies() -> None:
    document = Document.parse("a: &x [1]\nb: *x")
    data = document.to_dict()
    data["a"].append(2)
    assert data["b"] == [1]
    assert document.to_dict() == {"a": [1], "b": [1]}


def test_contains() -> None:
    document = Document.parse(GOOD)
    assert ("fields", 1, "middle", "joint") in document
    assert ("fields", 2) not in document
    assert ("fields", "type") not in document
    assert ("robot", 0) not in document


# -- what is not YAML, or more than data ----------------------------------------------

UNREADABLE = [
    ("", "1: is empty; a configuration is a mapping (key: value)"),
    ("\n# only this\n", "1: is empty; a configuration is a mapping (key: value)"),
    ("~", "1: is empty; a configuration is a mapping (key: value)"),
    ("\n- 1\n- 2", "2: is [1, 2]; a configuration is a mapping (key: value)"),
    ("robot", "1: is 'robot'; a configuration is a mapping (key: value)"),
    ("a: 1\nb:\n  c: 1\n  c: 2", "4: b.c: the key 'c' is given twice, first on line 3"),
    ("a: 1\n'a': 2", "2: a: the key 'a' is given twice, first on line 1"),
    ("a:\n  1: b", "2: a: a key must be text, and 1 is not; put it in quotes"),
    ("true: b", "1: a key must be text, and true is not; put it in quotes"),
    ("a: [{? [b] : c}]", "1: a.0: a key must be text, not a list or a mapping"),
    (
        "a: &x {b: 1}\nc:\n  <<: *x",
        "3: c: merge keys (<<) are not supported; write the keys out",
    ),
    (
        "a:\n- !!python/object/apply:os.system ['false']",
        "2: a.0: the tag '!!python/object/apply:os.system' is not allowed: "
        "plain data only",
    ),
    ("a: !gain 3", "1: a: the tag '!gain' is not allowed: plain data only"),
    ("a: !!int [1]", "1: a: the tag '!!int' is not allowed: plain data only"),
    ("!!set {a, b}", "1: the tag '!!set' is not allowed: plain data only"),
    ("a: !!bool on", "1: a: 'on' cannot be read as true or false"),
    ("a: !!float x", "1: a: 'x' cannot be read as a number"),
    (
        "a: 18446744073709551616",
        "1: a: '18446744073709551616' cannot be read as an integer of 64 bits",
    ),
    (
        f"a: {'9' * 5000}",
        f"1: a: '{'9' * 35}...' cannot be read as an integer of 64 bits",
    ),
    ('a: "\\ud800"', r"1: a: '\ud800' cannot be read as text"),
    ("a: 1\n\tb: 2", "2: not YAML: a tab; indent with spaces"),
    (
        "a: b: c",
        "1: not YAML: no key can stand here; check the indentation, "
        "and quote texts that hold ': '",
    ),
    (
        "a:\n  b: 1\n c: 2",
        "3: not YAML: the indentation does not fit the lines above",
    ),
    ("a: *b", "1: not YAML: found undefined alias 'b'"),
    (
        "a: @home",
        "1: not YAML: while scanning for the next token, "
        "found character '@' that cannot start any token",
    ),
    (
        "a: [1,\nb: 2\n",
        "3: not YAML: while parsing a flow sequence from line 1, "
        "expected ',' or ']', but got '<stream end>'",
    ),
    (
        "a: 1\n---\nb: 2",
        "2: not YAML: expected a single document in the stream from line 1, "
        "but found another document",
    ),
    ("a: 1\nb: \x07", "2: not YAML: the character U+0007"),
    ('a:\n  "\\UFFFFFFFF"', "2: not YAML: an escape or a version that is out of range"),
    ("a: &x [1, *x]", "1: a.1: an alias of a value that contains it"),
    ("a:\n  " + "[" * 60, "2: nested deeper than 50 levels"),
    (
        "a: &a {b: &b {c: &c [1]}}\nd:\n  "
        + "".join(f"{{x{i}: " for i in range(48))
        + "*a"
        + "}" * 48,
        "1: nested deeper than 50 levels",
    ),
    (
        "a: [" + "1, " * MAX_VALUES,
        f"1: more than {MAX_VALUES} values (aliases expanded)",
    ),
]


@pytest.mark.parametrize(("text", "expected"), UNREADABLE)
def test_what_cannot_be_read(text: str, expected: str) -> None:
    assert message(text) == f"panda.yaml:{expected}"


def test_aliases_do_not_grow_without_bound() -> None:
    laughs = ["a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha, ha]"]
    laughs += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 30)]
    expected = f"panda.yaml:1: more than {MAX_VALUES} values (aliases expanded)"
    assert message("\n".join(laughs)) == expected


def test_size_is_bounded() -> None:
    too_large = "panda.yaml: larger than 1 MB, too much for a configuration"
    assert message("#" * (MAX_SIZE + 1)) == too_large


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("pnda.yaml", None, ": no such file; did you mean 'panda.yaml'?"),
        ("x.yaml", None, ": no such file"),
        ("folder", None, ": is a folder; name a file in it"),
        ("a\0b", None, ": cannot be read: embedded null byte"),
        ("latin.yaml", b"a: 1\nb: caf\xe9", ":2: not UTF-8 text (byte 0xe9)"),
        (
            "large.yaml",
            b"#" * (MAX_SIZE + 1),
            ": larger than 1 MB, too much for a configuration",
        ),
        (
            "list.yaml",
            b"- a",
            ":1: is ['a']; a configuration is a mapping (key: value)",
        ),
    ],
)
def test_files_that_cannot_be_read(
    tmp_path: Path, name: str, content: bytes | None, expected: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "panda.yaml").write_text(GOOD, encoding="utf-8")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        Document.read(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}{expected}"


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "bom.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    document = Document.read(path)
    assert document.to_dict() == {"a": 1, "b": 2}
    assert document.location(("b",)) == f"{path}:2"


# -- what does not follow the schema --------------------------------------------------

TASK = "robot: panda\ntasks:\n  hand:\n    frame: hand\n"
"""Four lines, after which a test adds a key to the task."""

INVALID = [
    # keys
    (
        "robot: panda\nfields:\n- type: manipulability\n  wieght: 1",
        "4: fields.0.wieght: unknown key 'wieght'; did you mean 'weight'? "
        "(allowed: type, weight, reference)",
    ),
    (
        TASK + "    trajectory: {type: circle, radius: 1, circle: 3}",
        "5: tasks.hand.trajectory.circle: unknown key 'circle' "
        "(allowed: type, radius, center)",
    ),
    (
        TASK + "    gains:\n      Kp: 3",
        "6: tasks.hand.gains.Kp: unknown key 'Kp'; did you mean 'kp'? "
        "(allowed: kp, kd)",
    ),
    ("steps: 2", "1: missing key 'robot'; required here: robot"),
    ("{}", "1: missing key 'robot'; required here: robot"),
    (
        TASK + "    trajectory:\n      type: line",
        "5: tasks.hand.trajectory: missing key 'to'; required here: type, to",
    ),
    (
        "robot: a\ntasks: {a: {}}",
        "2: tasks.a: missing key 'frame'; required here: frame",
    ),
    (
        "robot: a\nframes: {'tool tip': [0, 0, 0]}",
        "2: frames.'tool tip': the key 'tool tip' should match pattern '^[a-z_.]+$'",
    ),
    # choices
    (
        TASK + "    trajectory:\n      type: circel\n      radius: 1",
        "6: tasks.hand.trajectory.type: unknown type 'circel'; did you mean 'circle'? "
        "(allowed: circle, line, segment)",
    ),
    (
        TASK + "    trajectory: {type: 3}",
        "5: tasks.hand.trajectory.type: unknown type 3 "
        "(allowed: circle, line, segment)",
    ),
    (
        TASK + "    trajectory: {radius: 3}",
        "5: tasks.hand.trajectory: missing key 'type'; "
        "type is one of: circle, line, segment",
    ),
    (
        TASK + "    trajectory:\n      radius: 3\n      tpye: circle",
        "7: tasks.hand.trajectory.tpye: unknown key 'tpye'; did you mean 'type'? "
        "(type is one of: circle, line, segment)",
    ),
    (
        "robot: a\nintegrator: RK45",
        "2: integrator: unknown value 'RK45'; did you mean 'rk4'? "
        "(allowed: euler, rk4)",
    ),
    ("robot: a\nintegrator: 4", "2: integrator: unknown value 4 (allowed: euler, rk4)"),
    # types
    ("robot: 3", "1: robot: 3 is an integer; expected text"),
    ("robot:", "1: robot: nothing given; expected text"),
    ("robot: [a]", "1: robot: ['a'] is a list; expected text"),
    ("robot: a\nsteps: 1.5", "2: steps: 1.5 is a decimal number; expected an integer"),
    ("robot: a\nsteps: true", "2: steps: true is a boolean; expected an integer"),
    ("robot: a\nview: on", "2: view: 'on' is text; expected true or false"),
    ("robot: a\nview: 1", "2: view: 1 is an integer; expected true or false"),
    (
        "robot: a\ntasks:\n- a",
        "2: tasks: ['a'] is a list; expected a mapping",
    ),
    (
        "robot: a\nfields: {type: centering}",
        "2: fields: {type: 'centering'} is a mapping; expected a list of mappings",
    ),
    ("robot: a\nfields: [x]", "2: fields.0: 'x' is text; expected a mapping"),
    (
        TASK + "    gains: [" + "{a: [[1]]}, " * 20 + "]",
        "5: tasks.hand.gains: [{a: [[...]]}, {a: [[...]]}, {a: [[..... is a list; "
        "expected a mapping",
    ),
    ("robot: a\nframes: 3", "2: frames: 3 is an integer; expected a mapping"),
    (
        "robot: a\nframes: {tip: 3}",
        "2: frames.tip: 3 is an integer; expected a list of 3 numbers",
    ),
    # numbers
    (
        TASK + "    gains:\n      kp: -3.0",
        "6: tasks.hand.gains.kp: -3.0 is negative; must be greater than 0",
    ),
    (
        TASK + "    gains: {kp: 0}",
        "5: tasks.hand.gains.kp: 0 is too small; must be greater than 0",
    ),
    (
        "robot: a\nfields: [{type: manipulability, weight: 1.5}]",
        "2: fields.0.weight: 1.5 is too large; must be at most 1",
    ),
    (
        "robot: a\nfields: [{type: manipulability, weight: -1}]",
        "2: fields.0.weight: -1 is negative; must be at least 0",
    ),
    (
        TASK + "    gains: {kp: .nan}",
        "5: tasks.hand.gains.kp: .nan is not a finite number",
    ),
    (
        TASK + "    gains: {kp: [1, -.inf]}",
        "5: tasks.hand.gains.kp.1: -.inf is not a finite number",
    ),
    (
        TASK + "    gains: {kp: 1e400}",
        "5: tasks.hand.gains.kp: .inf is not a finite number",
    ),
    # unions: one message, about the alternative that was meant
    (
        TASK + "    gains: {kp: fast}",
        "5: tasks.hand.gains.kp: 'fast' is text; "
        "expected a number, a list of numbers or a matrix",
    ),
    (
        TASK + "    gains: {kp: }",
        "5: tasks.hand.gains.kp: nothing given; "
        "expected a number, a list of numbers or a matrix",
    ),
    (
        TASK + "    gains: {kp: {a: 1}}",
        "5: tasks.hand.gains.kp: {a: 1} is a mapping; "
        "expected a number, a list of numbers or a matrix",
    ),
    (
        TASK + "    gains:\n      kp: [1,\n        fast]",
        "7: tasks.hand.gains.kp.1: 'fast' is text; expected a number",
    ),
    (
        TASK + "    gains: {kp: [fast]}",
        "5: tasks.hand.gains.kp.0: 'fast' is text; "
        "expected a number or a list of numbers",
    ),
    (
        TASK + "    gains: {kp: [[1], [2, fast]]}",
        "5: tasks.hand.gains.kp.1.1: 'fast' is text; expected a number",
    ),
    (
        TASK + "    gains: {kp: [[1], 2]}",
        "5: tasks.hand.gains.kp.1: 2 is an integer; expected a list of numbers",
    ),
    (
        TASK + "    gains: {kp: [[[1]]]}",
        "5: tasks.hand.gains.kp.0.0: [1] is a list; expected a number",
    ),
    (
        TASK + "    gains: {kp: [[1], [-1]]}",
        "5: tasks.hand.gains.kp.1.0: -1 is negative; must be greater than 0",
    ),
    (
        TASK + "    damping: critcal",
        "5: tasks.hand.damping: 'critcal' is text; expected 'critical' or a number; "
        "did you mean 'critical'?",
    ),
    (
        TASK + "    damping: -1",
        "5: tasks.hand.damping: -1 is negative; must be greater than 0",
    ),
    (
        "robot: a\nfields: [{type: centering, middle: 1}]",
        "2: fields.0.middle: 1 is an integer; expected a list of numbers or a mapping",
    ),
    (
        "robot: a\nfields: [{type: centering, middle: {joint: x}}]",
        "2: fields.0.middle.joint: 'x' is text; expected a number",
    ),
    (
        "robot: a\nroute: 3",
        "2: route: 3 is an integer; expected a mapping or a list of mappings",
    ),
    (
        "robot: a\nroute: {type: circel}",
        "2: route.type: unknown type 'circel'; did you mean 'circle'? "
        "(allowed: circle, line, segment)",
    ),
    (
        "robot: a\nroute:\n- {type: circle, radius: 1}\n- {type: circle, raduis: 1}",
        "4: route.1.raduis: unknown key 'raduis'; did you mean 'radius'? "
        "(allowed: type, radius, center)",
    ),
    # lengths
    (
        TASK + "    trajectory: {type: line, to: [1, 2]}",
        "5: tasks.hand.trajectory.to: [1, 2] has 2 entries, needs 3",
    ),
    (
        TASK + "    trajectory: {type: line, to: [1, 2, 3, 4]}",
        "5: tasks.hand.trajectory.to: [1, 2, 3, 4] has 4 entries, needs 3",
    ),
    (
        TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1], [], []]}",
        "5: tasks.hand.trajectory.via: [[1], [], []] has 3 entries, needs at most 2",
    ),
    (
        TASK + "    trajectory: {type: line, to: [1, 0, 0], via: [[1]]}",
        "5: tasks.hand.trajectory.via.0: [1] has 1 entry, needs 3",
    ),
    (
        "robot: a\ntasks: {b: {frame: ''}}",
        "2: tasks.b.frame: '' has 0 characters, needs at least 1",
    ),
    # our own validators
    (
        TASK + "    trajectory: {type: line, to: [0, 0, 0]}",
        "5: tasks.hand.trajectory: a line of length 0; move 'to' away from the origin",
    ),
]


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
        (
            "colour: rad",
            "colour: unknown value 'rad'; did you mean 'red'? (allowed: red, blue)",
        ),
        ("alias: x", "alias: 'x' is text; expected a number or a list of numbers"),
        (
            "nested: {type: pint}",
            "nested.type: unknown type 'pint'; did you mean 'point'? "
            "(allowed: circle, line, segment, point)",
        ),
        (
            "nested: {type: circle, radios: 1}",
            "nested.radios: unknown key 'radios'; did you mean 'radius'? "
            "(allowed: type, radius, center)",
        ),
        (
            "chosen: {type: circle, radius: x}",
            "chosen.radius: 'x' should be a valid number",
        ),
        ("chosen: {type: line}", "chosen: missing key 'to'"),
        ("chosen: {type: circle, radius: 1, x: 1}", "chosen.x: unknown key 'x'"),
        ("modes: x", "modes: 'x' is text; expected a list of 'a', 'b' or booleans"),
        ("modes: [c]", "modes.0: 'c' is text; expected 'a', 'b' or true or false"),
        ("several: 1", "several: 1 is an integer; expected a list of matrices"),
        ("bare: 1", "bare: 1 is an integer; expected a list of values"),
        (
            "day: tomorrow",
            "day: 'tomorrow' should be a valid date or datetime, input is too short",
        ),
        ("call: 1", "call: 1 should be callable"),
        ("new-name: 10", "new-name: 10 is too large; must be less than 10"),
    ],
)
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


def test_the_others_follow_one_a_line() -> None:
    assert message("robot: a\nsteps: x\nview: y") == (
        "panda.yaml:2: steps: 'x' is text; expected an integer\n"
        "and 1 more:\n"
        "  panda.yaml:3: view: 'y' is text; expected true or false"
    )


def test_keys_missing_together_are_one_mistake() -> None:
    class Empty(Part):
        first: int
        second: int
        third: int = 0

    expected = "missing keys 'first', 'second'; required here: first, second"
    assert message("third: 1", model=Empty) == f"panda.yaml:1: {expected}"


# -- overrides ------------------------------------------------------------------------


def test_overrides_change_values_and_their_origin() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    document.override("tasks.hand.gains.kp=[1e2, 2]")
    document.override("fields.0.weight = 0.25")
    document.override("frames.'tool.tip'.2=1")
    document.override('steps="3"')
    document.override("steps=3")
    scenario = validate(document, Scenario)
    assert scenario.tasks["hand"].gains == Gains(kp=[100.0, 2.0], kd=20.0)
    assert scenario.tasks["elbow"].gains == Gains(kp=100.0, kd=20.0)  # a copy
    assert scenario.fields[0].weight == 0.25
    assert scenario.frames is not None
    assert scenario.frames.root == {"tool.tip": [0.0, 0.0, 1.0]}
    assert scenario.steps == 3
    kp = ("tasks", "hand", "gains", "kp")
    assert document.location(kp) == "--set tasks.hand.gains.kp=[1e2, 2]"
    assert document.location((*kp, 1)) == "--set tasks.hand.gains.kp=[1e2, 2]"
    assert document.mark(kp) is None
    assert document.location(kp[:-1]) == "panda.yaml:5"
    assert document.location(("steps",)) == "--set steps=3"


def test_overrides_create_mappings_and_fill_empty_ones() -> None:
    document = Document.parse("a:\nb: [~]")
    document.override("a.b.c=")
    document.override("b.0.c=d")
    assert document.to_dict() == {"a": {"b": {"c": None}}, "b": [{"c": "d"}]}
    assert document.location(("a", "b")) == "<string>:1"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("steps", "needs the form key=value, for example tasks.0.gains.kp=100"),
        ("=3", "needs the form key=value, for example tasks.0.gains.kp=100"),
        ("a..b=3", "needs the form key=value, for example tasks.0.gains.kp=100"),
        ("robot.name=3", "robot is 'panda', which has no keys"),
        ("fields.2.weight=3", "fields has no entry '2' (entries: 0 to 1)"),
        ("fields.-1.weight=3", "fields has no entry '-1' (entries: 0 to 1)"),
        ("fields.first=3", "fields has no entry 'first' (entries: 0 to 1)"),
        (
            "fields.0=[1,",
            "not YAML: while parsing a flow node, "
            "expected the node content, but found '<stream end>'",
        ),
        ("steps=!!x 1", "the tag '!!x' is not allowed: plain data only"),
        (
            "steps=a\nb: 1",
            "not YAML: no key can stand here; check the indentation, "
            "and quote texts that hold ': '",
        ),
        ("steps=x", "steps: 'x' is text; expected an integer"),
        (
            "fields.0.wieght=1",
            "fields.0.wieght: unknown key 'wieght'; did you mean 'weight'? "
            "(allowed: type, weight, reference)",
        ),
        (
            "fields.1={type: x}",
            "fields.1.type: unknown type 'x' (allowed: manipulability, centering)",
        ),
        (
            "tasks.foot.gains.kp=1",
            "tasks.foot: missing key 'frame'; required here: frame",
        ),
    ],
)
def test_mistakes_in_overrides(override: str, expected: str) -> None:
    origin = f"--set {' '.join(override.split())}"
    if expected.startswith("tasks.foot"):  # the task was created, not written
        origin = "panda.yaml:2"
    assert message(GOOD, override) == f"{origin}: {expected}"


def test_long_overrides_are_cut() -> None:
    deep = ".".join("a" * 60)
    cut = f"--set {deep}"[:69]
    assert message(GOOD, f"{deep}=1") == f"{cut}...: nested deeper than 50 levels"


def test_mistakes_of_overrides_come_last() -> None:
    assert message("robot: a\nview: 3", "steps=x") == (
        "panda.yaml:2: view: 3 is an integer; expected true or false\n"
        "and 1 more:\n"
        "  --set steps=x: steps: 'x' is text; expected an integer"
    )


# -- errors raised later --------------------------------------------------------------


def test_errors_raised_later_are_located() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    with (
        pytest.raises(FrameNotFoundError) as caught,
        document.at("tasks"),
        document.at("tasks", "hand", "frame"),
    ):
        raise FrameNotFoundError("no frame 'hnad'")
    assert str(caught.value) == "panda.yaml:4: tasks.hand.frame: no frame 'hnad'"
    assert caught.value.location == "panda.yaml:4"
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (str(copy), copy.location) == (str(caught.value), "panda.yaml:4")


def test_located_errors_stay_as_they_are() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    with pytest.raises(ConfigError) as caught, document.at("tasks"):
        validate(Document.parse("steps: x\nrobot: a", "other.yaml"), Scenario)
    assert str(caught.value) == "other.yaml:1: steps: 'x' is text; expected an integer"


def test_other_errors_pass() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    with pytest.raises(ZeroDivisionError, match=r"^division by zero$"), document.at():
        print(1 / 0)


def test_errors_of_overridden_keys_name_the_override() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    document.override("tasks.hand.gains.kp=[1, 2]")
    with (
        pytest.raises(ShapeError) as caught,
        document.at("tasks", "hand", "gains", "kp"),
    ):
        raise ShapeError("needs 3 numbers")
    origin = "--set tasks.hand.gains.kp=[1, 2]"
    assert str(caught.value) == f"{origin}: tasks.hand.gains.kp: needs 3 numbers"


def test_long_keys_are_cut() -> None:
    error = Document.parse("a: 1").error(("a " * 50,), "is bad")
    assert str(error) == f"<string>:1: '{'a ' * 18}a...': is bad"


def test_errors_can_be_made_for_a_place() -> None:
    error = Document.parse("a b: {'': 1}", "x.yaml").error(("a b", ""), "is bad")
    assert (str(error), error.location) == ("x.yaml:1: 'a b'.'': is bad", "x.yaml:1")


# -- names ----------------------------------------------------------------------------


def test_the_nearest_name_is_suggested() -> None:
    frames = ["universe", "panda_link7", "panda_hand", "panda_hand_tcp"]
    assert did_you_mean("panda_hnad", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("hand", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("UNIVERSE", frames) == "; did you mean 'universe'?"
    assert did_you_mean("xyz", frames) == ""
    assert nearest("", frames) is None
    assert nearest("a", []) is None


def test_long_lists_of_names_are_cut() -> None:
    assert listing("abc") == "a, b, c"
    assert listing("abcdefg", limit=3) == "a, b, c, ... (7 in all)"
    assert listing([]) == ""


# -- anything else is success or one ConfigError --------------------------------------


def check(text: str, *overrides: str) -> None:
    """Validate a text; allow success, or an error that says where."""
    error = None
    try:
        read(text, *overrides)
    except ConfigError as caught:
        error = caught
    if error is not None:
        assert error.location is not None
        assert error.location.startswith(("panda.yaml:", "--set "))
        assert str(error).encode().startswith(error.location.encode())


SNIPPETS = st.one_of(
    st.text(max_size=3),
    st.sampled_from([*"\t\n:-[]{},&*!|>'\"%@`#?~.", "\n  ", "- ", "? "]),
    st.sampled_from(["&soft", "*soft", "<<: *soft", "!!int ", "!x ", "---\n", "...\n"]),
    st.sampled_from([".nan", "-.inf", "1e999", "null", "on", "'", "[[1]]", "{a: 1}"]),
    st.sampled_from(["type", "circle", "line", "kp", "-1", "9" * 400, '"\\uD800"']),
)


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """Return the good text with a few stretches replaced."""
    text = GOOD
    for _ in range(draw(st.integers(1, 5))):
        start = draw(st.integers(0, len(text)))
        stop = start + draw(st.integers(0, 12))
        text = text[:start] + draw(SNIPPETS) + text[stop:]
    return text


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from(["circle"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["type", "kp", "gains", "trajectory", "line", "circle", "to"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=8,
)


@given(mutated())
@settings(max_examples=400, deadline=None)
def test_mutated_texts(text: str) -> None:
    check(text)


@given(st.dictionaries(st.sampled_from(list(Scenario.model_fields)), PLAIN))
@settings(max_examples=200, deadline=None)
def test_mutated_data(data: dict[str, object]) -> None:
    check(yaml.safe_dump({"robot": "a", **data}))


@given(
    st.sampled_from(["tasks.hand.gains.kp", "fields.0", "fields.0.type", "route", "a"]),
    PLAIN,
)
@settings(max_examples=100, deadline=None)
def test_mutated_overrides(path: str, value: object) -> None:
    check(GOOD, f"{path}={yaml.safe_dump(value, default_flow_style=True)}")


@given(st.text())
@settings(max_examples=100, deadline=None)
@example("fields.\u00b2=1")
@example("'=1")
def test_any_override(text: str) -> None:
    check(GOOD, text, f"{text}=1", f"tasks.{text}")
