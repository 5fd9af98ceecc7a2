"""The declaration of parts: families, constructors, messages, schemas and values."""

import copy
import dataclasses
import inspect
import math
import pickle
import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from values import assert_is_a_value
from wording import wording

from hsp_control.common.errors import ConfigError, HspControlError
from hsp_control.declaration import AnyOf, Part, families
from hsp_control.declaration.quantities import (
    Count,
    Flag,
    Fraction,
    Gain,
    Matrix,
    Name,
    Names,
    NonNegative,
    Number,
    Periods,
    Positive,
    PositiveCount,
    ProperFraction,
    Share,
    Tensor,
    Vector,
    Vector3,
    Weights,
)
from hsp_control.trajectories import Circle, StreamPose, Trajectory
from hsp_control.trajectories.orientation import OrientationTrajectory
from hsp_control.trajectories.pose import PoseTrajectory


class GadgetError(HspControlError, ValueError):
    """An error of a gadget."""


class Gadget(Part, ABC, family="gadgets", error=GadgetError):
    """Anything with a label.

    The second paragraph is not its summary.
    """

    _: KW_ONLY
    label: str = "gadget"
    """The name of it,
    on one line [-]."""

    @property
    @abstractmethod
    def size(self) -> float:
        """How large it is."""


class Ball(Gadget, type="ball"):
    """A round one."""

    radius: Positive
    """Radius [m]."""
    center: Vector3 = (0.0, 0.0, 0.0)
    """Center [m]."""

    @property
    def size(self) -> float:
        """The diameter."""
        return 2.0 * self.radius


class Rod(Gadget, type="rod"):
    """A long one."""

    size: Positive
    """Length [m]; a field, where the base class requires a property."""
    mass: NonNegative = 1.0
    """Mass [kg]."""

    def __post_init__(self) -> None:
        """Check the density."""
        if self.mass > 10.0 * self.size:
            raise GadgetError(f"a mass of {self.mass} is too much for this size")


class Bag(Gadget, type="bag"):
    """A part with other parts in it."""

    first: Gadget
    """Its content."""
    spare: Gadget | None = None
    """Its optional content."""
    grid: Matrix = ((1.0, 0.0), (0.0, 1.0))
    """Two rows [-]."""
    counts: dict[str, Vector] = dataclasses.field(default_factory=dict)
    """Numbers by name [-]."""

    @property
    def size(self) -> float:
        """That of its content."""
        return self.first.size


class Tool(Part, family="tools", error=GadgetError):
    """Something else."""


class Hammer(Tool, type="hammer"):
    """For nails."""

    weight: Number
    """Weight [kg]."""


class Stick(Tool, type="rod"):
    """Another rod."""


class Box(Part, error=GadgetError):
    """A part of parts, with one field of each kind."""

    number: Number = 1.0
    """A [-]."""
    positive: Positive = 1.0
    """B [-]."""
    non_negative: NonNegative = 0.0
    """C [-]."""
    count: Count = 0
    """D [-]."""
    flag: Flag = False
    """E [-]."""
    name: Name = "box"
    """F [-]."""
    names: Names = ()
    """G [-]."""
    vector: Vector = (1.0,)
    """H [-]."""
    tensor: Tensor = (((1.0,),),)
    """I [-]."""
    gain: Gain = 1.0
    """J [-]."""
    weights: Weights = 1.0
    """K [-]."""
    either: Annotated[Gadget | Tool, AnyOf(Gadget, Tool)] = Ball(1.0)
    """L [-]."""
    degree: Literal[3, 5] = 3
    """M [-]."""


BALL = Ball(0.5, [1, 2, 3], label="red")
BAG = Bag(BALL, Rod(2.0), counts={"a": [1, 2]})
VALUES = {"ball": BALL, "rod": Rod(1.0), "bag": BAG, "box": Box(), "tool": Stick()}
every_value = pytest.mark.parametrize("name", VALUES)


# --- constructors ---------------------------------------------------------------------


def test_a_default_may_depend_on_other_fields() -> None:
    class Pair(Part):
        one: Number
        other: Number | None = None

        def _complete(self) -> None:
            if self.other is None:
                self._set_default("other", 2.0 * self.one)

        def __post_init__(self) -> None:
            assert self.other is not None

    assert Pair(1.0) == Pair(1.0, 2.0)
    assert Pair(1.0).other == 2.0
    assert Pair(1.0, 3.0).other == 3.0


def test_abstract_parts_and_own_constructors_are_refused() -> None:
    with pytest.raises(TypeError, match="abstract"):
        Gadget()  # type: ignore[abstract]
    with pytest.raises(TypeError, match="Own must not have __init__: declare its"):

        class Own(Part):
            def __init__(self, a: float) -> None:
                pass


# --- families -------------------------------------------------------------------------


def test_a_type_is_declared_once() -> None:
    class Local(Part, family="locals"):
        pass

    class One(Local, type="one"):
        a: Number = 0.0

    with pytest.raises(ConfigError, match=r"type 'one' of locals .*One and by .*Two$"):

        class Two(Local, type="one"):
            pass

    assert Local.family is not None
    assert Local.family.members == {"one": One}
    validated = TypeAdapter(Local)
    assert validated.validate_python({"type": "one", "a": 3}) == One(3)
    first = One

    class One(Local, type="one"):  # type: ignore[no-redef]
        a: Number = 5.0

    # Defined again, as by rerunning a notebook's cell.
    assert first is not One
    assert Local.family.members == {"one": One}
    assert type(validated.validate_python({"type": "one"})) is One


class Entry:
    """An entry point that declares its class when it is loaded."""

    value = "package:Plugged"
    module = "package"

    def __init__(self, name: str, load: Callable[[], Any]) -> None:
        self.name, self.load = name, load


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Return a function that installs entry points for another family."""

    class Slot(Part, family="slots", error=GadgetError):
        pass

    class Known(Slot, type="known"):
        pass

    class Holder(Part, error=GadgetError):
        slot: Slot

    def install(**loaders: Callable[[type[Slot]], Any]) -> Any:
        entries = {n: Entry(n, lambda f=f: f(Slot)) for n, f in loaders.items()}

        def found(group: str) -> dict[str, Entry]:
            return entries if group == "slots" else {}

        monkeypatch.setattr(families, "entry_points", found)
        return Holder

    return install


def test_a_plugin_is_imported_when_it_is_named(plug: Callable[..., Any]) -> None:
    imported = []

    def plugged(base: Any) -> Any:
        imported.append("plugged")

        class Plugged(base, type="plugged"):
            force: Positive

        return Plugged

    holder = plug(plugged=plugged, broken=lambda base: 1 / 0)
    holder({"type": "known"})
    with pytest.raises(GadgetError, match=r"slot.type: unknown type 'pluged'"):
        holder({"type": "pluged"})
    assert imported == []
    assert holder({"type": "plugged", "force": 2}).slot.force == 2.0
    assert holder({"type": "plugged", "force": 3}).slot.force == 3.0
    assert imported == ["plugged"]
    with pytest.raises(GadgetError, match=r"^Holder: slot.force: -2 is negative"):
        holder({"type": "plugged", "force": -2})


def test_a_plugin_that_does_not_work_is_named(plug: Callable[..., Any]) -> None:
    def missing(base: Any) -> Any:
        raise ImportError("no module named package")

    holder = plug(missing=missing, other=lambda base: int)
    with pytest.raises(
        ConfigError, match=r"slot: type 'missing' cannot be imported fr"
    ):
        holder({"type": "missing"})
    with pytest.raises(ConfigError, match=r"package:Plugged does not declare the type"):
        holder({"type": "other"})


# --- messages -------------------------------------------------------------------------

MESSAGES: dict[str, Callable[[], Any]] = {
    "Ball: missing ... 'radius'": lambda: Ball(),  # type: ignore
    "Ball: radus: unknown ... 'radus' ... 'radius'": lambda: Ball(radus=1),  # type: ignore
    "Ball: takes 2 positional arguments (radius, center)": (
        lambda: Ball(1, [1, 2, 3], "red")  # type: ignore
    ),
    "Ball: radius: 'wide' ... a number": lambda: Ball("wide"),  # type: ignore
    "Ball: radius: -1 ... greater than 0": lambda: Ball(-1),
    "Ball: center: [1, 2] ... 2 ... 3": lambda: Ball(1, [1, 2]),
    "Ball: center.1: 'up' ... a number": lambda: Ball(1, [0, "up", 0]),
    "Ball: center: None ... a list of 3 numbers": (
     lambda: Ball(1, None)),
    "Rod: ... 11.0 ... too much": lambda: Rod(1.0, 11.0),
    "Bag: first: 3, an int ... a Gadget": lambda: Bag(3),  # type: ignore
    "Bag: first: a Hammer ... gadgets": lambda: Bag(Hammer(1)),  # type: ignore
    "Bag: first: {'radius': 1}, a dict ... a Gadget": (
        lambda: Bag({"radius": 1})  # type: ignore
    ),
    "Bag: first.type: unknown ... 'bal' ... 'ball'": (
        lambda: Bag({"type": "bal", "radius": 1})  # type: ignore
    ),
    "Bag: first.radus: unknown ... 'radus' ... 'radius'": (
        lambda: Bag({"type": "ball", "radus": 1})  # type: ignore
    ),
    "Bag: first: ... 11.0 ... too much": (
        lambda: Bag({"type": "rod", "size": 1, "mass": 11})  # type: ignore
    ),
    "Bag: spare.first.first.center.2: nan ... finite": (lambda: Bag(BALL,
        {"type": "bag", "first": {"type": "bag", "first": {  # type: ignore
              "type": "ball", "radius": 1, "center": [0, 0, math.nan]}}})),
    "Bag: grid: ... different lengths [1, 2]": (
     lambda: Bag(BALL, grid=[[1], [2, 3]])),
    "Bag: counts.a: 'many' ... a list of numbers": (
     lambda: Bag(BALL, counts={"a": "many"})),
    "Box: number: inf ... finite": lambda: Box(math.inf),
    "Box: number: True ... a number": lambda: Box(True),
    "Box: count: 1.5 ... an int": lambda: Box(count=1.5),  # type: ignore
    "Box: flag: 1 ... True": lambda: Box(flag=1),  # type: ignore
    "Box: name: '' ... 0 ... at least 1": lambda: Box(name=""),
    "Box: names.1: 3 ... a str": lambda: Box(names=["a", 3]),  # type: ignore
    "Box: vector: [] ... 0 ... at least 1": lambda: Box(vector=[]),
    "Box: tensor: ... different lengths": (
     lambda: Box(tensor=[[[1], [2, 3]]])),
    "Box: gain: -1 ... greater than 0": lambda: Box(gain=-1),
    "Box: gain: 'stiff' ... a number": (
     lambda: Box(gain="stiff")),
    "Box: weights.1: -1 ... at least 0": lambda: Box(weights=[1, -1]),
    "Box: degree: unknown ... 4 (allowed: 3, 5)": lambda: Box(degree=4),  # type: ignore
}  # fmt: skip


@pytest.mark.parametrize("message", MESSAGES)
def test_a_mistake_is_one_error_in_plain_words(message: str) -> None:
    with pytest.raises(GadgetError) as caught:
        MESSAGES[message]()
    assert re.search(wording(message), str(caught.value))
    assert caught.value.__suppress_context__  # pydantic's own report is not shown


def test_errors_are_those_of_the_class_that_was_called() -> None:
    class Own(Part):
        gadget: Gadget

    with pytest.raises(GadgetError, match=r"^Ball: radius: -1"):
        Own(Ball(-1))
    with pytest.raises(HspControlError, match=r"^Own: gadget.radius: -1") as caught:
        Own({"type": "ball", "radius": -1})  # type: ignore[arg-type]
    assert type(caught.value) is HspControlError
    with pytest.raises(GadgetError, match=r"^Own: gadget: a mass of"):
        Own({"type": "rod", "size": 1, "mass": 11})  # type: ignore[arg-type]


# --- schemas --------------------------------------------------------------------------


def test_the_schema_describes_every_field() -> None:
    schema = TypeAdapter(Gadget).json_schema()
    assert schema["discriminator"] == {"propertyName": "type"}
    assert len(schema["oneOf"]) == 3
    by_type = {d["properties"]["type"]["const"]: d for d in schema["$defs"].values()}
    assert set(by_type) == {"ball", "rod", "bag"}
    for described in by_type.values():
        assert described["additionalProperties"] is False
        for about in described["properties"].values():
            assert about["description"]
            assert "title" not in about
    ball = by_type["ball"]["properties"]
    assert by_type["ball"]["required"] == ["type", "radius"]
    assert ball["type"]["description"] == "ball: A round one."
    assert ball["label"]["description"] == "The name of it, on one line [-]."
    assert ball["radius"]["type"] == "number"
    assert ball["radius"]["exclusiveMinimum"] == 0
    assert ball["center"]["minItems"] == ball["center"]["maxItems"] == 3
    assert by_type["rod"]["properties"]["mass"]["minimum"] == 0


FAMILIES = [Gadget, Tool, Trajectory, OrientationTrajectory, PoseTrajectory]


@pytest.mark.parametrize("base", FAMILIES, ids=lambda base: base.__name__)
def test_every_property_has_a_description(base: type[Part]) -> None:
    assert base.family is not None
    schema = TypeAdapter(base).json_schema()
    kinds = {
        each["properties"]["type"]["const"]
        for each in schema["$defs"].values()
        if "type" in each["properties"]
    }
    assert kinds >= set(base.family.members)
    for each in schema["$defs"].values():
        for name, about in each["properties"].items():
            assert about.get("description"), (each, name)
            assert "default" not in about or "oneOf" not in about


def test_signature_and_help_of_a_part() -> None:
    """A signature without pydantic's words, and the docstrings of the fields."""
    assert str(inspect.signature(Ball)) == (
        "(radius: float, center: ArrayLike = (0.0, 0.0, 0.0), *, label: str = 'gadget')"
    )
    assert str(inspect.signature(Bag)) == (
        "(first: Gadget, spare: Gadget | None = None, grid: ArrayLike = ((1.0, 0.0), "
        "(0.0, 1.0)), counts: dict[str, ArrayLike] = {}, *, label: str = 'gadget')"
    )
    assert Ball.__doc__ == (
        "A round one.\n\nArgs:\n    radius: Radius [m].\n    center: Center [m].\n"
        "    label: The name of it, on one line [-]."
    )
    assert TypeAdapter(Ball).json_schema()["description"] == "A round one."
    assert len(str(inspect.signature(StreamPose))) < 650
    assert "policy: The way in which waypoints are followed." in str(StreamPose.__doc__)


def test_docstrings_of_fields_are_inherited() -> None:
    label = "The name of it, on one line [-]."
    assert Ball.documentation == {
        "label": label, "radius": "Radius [m].", "center": "Center [m]."
    }  # fmt: skip

    class Marble(Ball, type=None):
        """A small one."""

        radius: Positive
        """Radius, at most 1 cm [m]."""
        glass: Flag = True

    assert Marble.documentation == {
        "label": label, "radius": "Radius, at most 1 cm [m].", "center": "Center [m]."
    }  # fmt: skip
    assert Ball.documentation["radius"] == "Radius [m]."
    assert Circle.documentation["origin"].startswith("Origin of the points")
    scope: dict[str, Any] = {"Part": Part, "__name__": "typed_in"}
    exec('class Typed(Part):\n    a: float\n    """A [-]."""', scope)
    assert scope["Typed"].documentation == {}  # without source text
    assert scope["Typed"](1).a == 1.0


# --- values ---------------------------------------------------------------------------


@every_value
def test_parts_are_values(name: str) -> None:
    value = VALUES[name]
    assert_is_a_value(value, {"np": np, **globals()})
    assert copy.copy(value) is copy.deepcopy(value) is value


def test_arrays_stay_read_only() -> None:
    given = np.ones(3)
    ball = Ball(1, given)
    given[0] = 9.0
    assert given.flags.writeable
    again = pickle.loads(pickle.dumps(Bag(ball, counts={"a": given})))
    for array in (ball.center, again.first.center, again.grid, again.counts["a"]):
        assert isinstance(array, np.ndarray)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0
    assert ball == Ball(1, [1, 1, 1])


def test_equality_looks_at_class_and_fields() -> None:
    assert Ball(1) == Ball(1.0)
    assert Ball(1) != Ball(2)
    assert Ball(1) != Ball(1, [0, 0, 1])
    assert Ball(1) != Ball(1, label="other")
    assert Rod(1) != Stick()
    assert Ball(1) != 1
    assert Box(gain=1) != Box(gain=[1])
    assert Box(gain=[1]) != Box(gain=[[1]])
    assert Box(gain=[1, 1]) != Box(gain=1)
    assert Bag(BALL) != Bag(BALL, Rod(1))
    assert Bag(BALL, counts={"a": [1]}) != Bag(BALL, counts={"a": [1, 2]})
    assert Bag(BALL, counts={"a": [1]}) != Bag(BALL, counts={"b": [1]})
    assert Box(names=["a"]) == Box(names=("a",))

    class Marble(Ball):
        """A subclass is another class."""

    assert Marble(1) != Ball(1)


@pytest.mark.parametrize(("kind", "allowed", "refused"), [
    (Positive, [1e-30, 9.0], [0.0, -1.0, math.inf]),
    (NonNegative, [0.0, 9.0], [-1e-300, math.inf]),
    (Share, [0.0, 0.99], [-1e-300, 1.0]),
    (Fraction, [1e-300, 1.0], [0.0, 1.01]),
    (ProperFraction, [1e-300, 0.99], [0.0, 1.0]),
    (Count, [0, 9], [-1]),
    (PositiveCount, [1, 9], [0]),
    (Periods, [0, 100_000], [-1, 100_001]),
])  # fmt: skip
def test_bounds_belong_to_a_number_or_do_not(
    kind: Any, allowed: list[float], refused: list[float]
) -> None:
    for value in allowed:
        assert TypeAdapter(kind).validate_python(value) == value
    for value in refused:
        with pytest.raises(ValidationError):
            TypeAdapter(kind).validate_python(value)


def test_names_of_files_are_stored_as_text() -> None:
    from hsp_control.declaration.quantities import FileName

    class File(Part):
        path: FileName

    assert File(Path("a") / "b.stl") == File("a/b.stl")
    assert TypeAdapter(File).json_schema()["properties"]["path"]["type"] == "string"
