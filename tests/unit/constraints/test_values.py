"""Contacts and limits are values: one set of tests for all of them, by reflection."""

import copy
import inspect
import pickle
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

import hsp_control.constraints.contacts as contacts
import hsp_control.constraints.limits as limits
from hsp_control import Hold, Obstacle, Sphere
from hsp_control.common.exceptions import ImmutableError
from hsp_control.constraints.contacts import (
    BallContact,
    CommandedForce,
    Contact,
    PointContact,
    SlidingContact,
    SurfaceContact,
)
from hsp_control.constraints.limits import (
    ByJoint,
    Limits,
    MinimumDistance,
    ObstacleDistance,
    PositionRange,
    PositionsByJoint,
    Scaled,
    SelfDistance,
)
from hsp_control.declaration import Part
from hsp_control.declaration.families import value_fields
from hsp_control.trajectories import Schedule

NAMES: dict[str, Any] = {
    name: each
    for module in (contacts, limits)
    for name, each in vars(module).items()
    if inspect.isclass(each)
} | {each.__name__: each for each in (Hold, Obstacle, Schedule, Sphere)}
CLASSES = sorted(
    {
        each
        for each in NAMES.values()
        if issubclass(each, Part) and "constraints" in each.__module__
    },
    key=lambda each: each.__name__,
)
MEMBERS = [each for each in CLASSES if not inspect.isabstract(each)]
TRIANGLE = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.01]]
BALL = Obstacle("ball", Sphere(0.1), Hold([0.4, 0.0, 0.5]))

EXAMPLES: dict[type[Part], Part] = {
    BallContact: BallContact("foot", radius=0.02),
    ByJoint: ByJoint({"joint": 20.0}),
    CommandedForce: CommandedForce(20.0),
    Limits: Limits(),
    ObstacleDistance: ObstacleDistance(),
    PointContact: PointContact("foot"),
    PositionRange: PositionRange([-1.0, None], [1.0, 2.0]),
    PositionsByJoint: PositionsByJoint({"joint": (-1.0, 2.0)}),
    Scaled: Scaled(0.5),
    SelfDistance: SelfDistance(),
    SlidingContact: SlidingContact("foot", force=CommandedForce(20.0)),
    SurfaceContact: SurfaceContact("foot", length=0.2, width=0.1),
}
"""One of each class."""

_CONTACT: dict[str, Any] = {
    "frame": "hand",
    "friction": 0.3,
    "normal": np.array([0.1, 0.0, 2.0]),
    "damping": 10,
    "schedule": Schedule([(1.0, None)]),
    "force": CommandedForce(5.0),
    "name": "left",
}
_MAXIMUM = [
    *("none", Scaled(0.5), Scaled({"b": 0.5, "a": 2}), ByJoint({"b": 5, "a": 2})),
    *(9, np.ones(7)),
]
_NUMBERS = [1000.0, [1, 2.5], [3.0, None], np.array([1.0, np.inf])]
OTHERS: dict[type[Part], dict[str, Any]] = {
    BallContact: {**_CONTACT, "radius": 0.03},
    ByJoint: {"joints": [{"joint": 3}, {"b": 2.0, "a": 1}]},
    CommandedForce: {"value": [3, [1, 0, 5.0], np.array([0, 0, 9, 0, 0, 1.0])]},
    Limits: {
        "effort": _MAXIMUM,
        "effort_rate": _MAXIMUM,
        "velocity": _MAXIMUM,
        "acceleration": _NUMBERS,
        "position": [
            "none",
            PositionRange(-1.0, [1.0, None]),
            PositionsByJoint({"joint": [-1, 2]}),
        ],
        "position_margin": 0.0,
        "velocity_margin": 0,
        "distances": [[SelfDistance()], (ObstacleDistance(0.1), SelfDistance(0.0))],
        "bandwidth": 5,
        "static_effort": 1,
    },
    ObstacleDistance: {
        "minimum": 0.0,
        "obstacles": [["ball", "box"], [BALL]],
        "links": [["hand"]],
    },
    PointContact: {**_CONTACT, "point": (0.1, 0, 0.0)},
    PositionRange: {
        "lower": [-2.0, [-2.0, None], (-np.inf, -3.0)],
        "upper": [9.0, np.array([1.5, np.inf])],
    },
    PositionsByJoint: {"joints": [{"joint": [-2, 2.0]}, {"a": (0, 1), "b": (0, 1)}]},
    Scaled: {"scale": [2, {"joint": 0.5}]},
    SelfDistance: {"minimum": 0.1},
    SlidingContact: {
        **_CONTACT,
        "point": (0.1, 0, 0.0),
        "offset": (0.0, 0, -0.1),
        "smoothing": 0.1,
    },
    SurfaceContact: {
        **_CONTACT,
        "length": 0.3,
        "width": 0.3,
        "center": (0.0, 0.0, 0.1),
    },
}
"""For each field, another value, or a list of them."""


def others(part: Part) -> Iterator[Part]:
    """Yield copies of the part with one other value each."""
    for field, values in OTHERS[type(part)].items():
        for value in values if isinstance(values, list) else [values]:
            yield replace(part, **{field: value})  # type: ignore[type-var]
    if isinstance(part, SurfaceContact):
        yield SurfaceContact("foot", corners=TRIANGLE)
    if isinstance(part, CommandedForce):
        yield CommandedForce(trajectory=Hold([20.0]))


ALL = [each for part in EXAMPLES.values() for each in (part, *others(part))]


def rebuilt(part: Part) -> Part:
    return type(part)(**{f.name: getattr(part, f.name) for f in value_fields(part)})


def test_every_class_and_every_field_is_tried() -> None:
    assert set(EXAMPLES) == set(OTHERS) == set(MEMBERS)
    for cls in MEMBERS:
        instead = {SurfaceContact: {"corners"}, CommandedForce: {"trajectory"}}
        tried = set(OTHERS[cls]) | instead.get(cls, set())
        assert tried == {field.name for field in value_fields(cls)}, cls


@pytest.mark.parametrize("cls", CLASSES)
def test_every_field_says_what_it_is_and_in_which_unit(cls: type[Part]) -> None:
    assert cls.__doc__
    for field in value_fields(cls):
        said = cls.documentation[field.name]
        assert re.search(r"\[[^\]]+\]", said), f"{cls.__name__}.{field.name}: {said}"


@pytest.mark.parametrize("part", ALL, ids=repr)
def test_equal_copies(part: Part) -> None:
    copies = (rebuilt(part), pickle.loads(pickle.dumps(part)), replace(part))  # type: ignore[type-var]
    for same in copies:
        assert type(same) is type(part)
        assert same == part
        assert hash(same) == hash(part)
        assert repr(same) == repr(part)
    assert copy.deepcopy(part) is copy.copy(part) is part


@pytest.mark.parametrize("part", ALL, ids=repr)
def test_repr_makes_an_equal_part(part: Part) -> None:
    assert eval(repr(part), dict(NAMES)) == part


def test_every_field_counts() -> None:
    assert len(set(ALL)) == len(ALL)
    for k, part in enumerate(ALL):
        assert [each == part for each in ALL].count(True) == 1
        assert ALL.index(part) == k


@pytest.mark.parametrize("part", ALL, ids=repr)
def test_nothing_can_be_changed(part: Part) -> None:
    for field in value_fields(part):
        value = getattr(part, field.name)
        with pytest.raises(ImmutableError, match=f"{field.name} cannot be assigned"):
            setattr(part, field.name, value)
        with pytest.raises(ImmutableError, match="cannot be deleted"):
            delattr(part, field.name)
        if isinstance(value, np.ndarray):
            assert not value.flags.writeable
        assert not isinstance(value, list | dict)
    with pytest.raises(ImmutableError):
        part.radios = 1.0  # type: ignore[attr-defined]


def test_computed_arrays_cannot_be_changed() -> None:
    for part in ALL:
        if isinstance(part, Contact):
            assert not part.points.flags.writeable
            assert not part.axes.flags.writeable


def test_what_was_given_may_change_afterwards() -> None:
    corners, factors, most = np.array(TRIANGLE), {"joint": 0.5}, np.ones(3)
    made = (
        SurfaceContact("foot", corners=corners),
        Scaled(factors),
        Limits(effort=most),
    )
    corners[:], factors["joint"], most[:] = 0.0, 2.0, 9.0
    assert made == (
        SurfaceContact("foot", corners=TRIANGLE),
        Scaled({"joint": 0.5}),
        Limits(effort=[1, 1, 1]),
    )


@pytest.mark.parametrize(
    ("family", "data", "part"),
    [
        (
            Contact,
            {"type": "surface", "frame": "foot", "length": 0.2, "width": 0.1},
            SurfaceContact("foot", length=0.2, width=0.1),
        ),
        (
            Contact,
            {"type": "point", "frame": "a", "schedule": {"intervals": [[None, 1.0]]}},
            PointContact("a", schedule=Schedule([(None, 1.0)])),
        ),
        (
            Contact,
            {"type": "ball", "frame": "a", "radius": 1, "normal": [0, 1, 0]},
            BallContact("a", radius=1.0, normal=[0, 1, 0]),
        ),
        (MinimumDistance, {"type": "self"}, SelfDistance(0.01)),
        (
            MinimumDistance,
            {"type": "obstacles", "minimum": 0.1, "obstacles": ["a"], "links": ["b"]},
            ObstacleDistance(0.1, obstacles=["a"], links=["b"]),
        ),
    ],
)
def test_as_yaml_says_it(family: type[Part], data: dict[str, Any], part: Part) -> None:
    assert TypeAdapter(family).validate_python(data) == part


def test_none_is_no_limit() -> None:
    assert Limits(effort=None, velocity=None, position=None) == Limits(
        effort="none", velocity="none", position="none"
    )


def test_limits_as_yaml_says_them() -> None:
    data: dict[str, Any] = {
        "effort": {"scale": {"a": 0.5}},
        "velocity": {"joints": {"a": 2}},
        "effort_rate": 1000,
        "acceleration": [1, None],
        "position": {"lower": [-1, None], "upper": [1, 2]},
        "distances": [{"type": "self"}, {"type": "obstacles", "minimum": 0.1}],
    }
    assert Limits(**data) == Limits(
        effort=Scaled({"a": 0.5}),
        velocity=ByJoint({"a": 2.0}),
        effort_rate=1000.0,
        acceleration=[1.0, np.inf],
        position=PositionRange([-1.0, -np.inf], [1.0, 2.0]),
        distances=(SelfDistance(), ObstacleDistance(0.1)),
    )


# --- what is refused -----------------------------------------------------------------

_WRONG_CONTACT: dict[str, list[tuple[Any, str]]] = {
    "frame": [(3, "3 is an integer; expected text")],
    "friction": [(0.0, "must be greater than 0"), (np.inf, "not a finite number")],
    "normal": [
        ([0, 0, 0], r"\[0.0, 0.0, 0.0\] has no direction; must not be zero"),
        ([0, 1], "has 2 entries, needs 3"),
        ([1e300, 1e300, 0], "has no direction"),
    ],
    "damping": [(-1, "-1 is negative; must be greater than 0")],
    "schedule": [("always", "expected a mapping")],
    "force": [(20.0, "expected a mapping")],
    "name": [(3, "name: 3 ")],
}
_WRONG_MAXIMUM: list[tuple[Any, str]] = [
    (-1.0, "-1.0 is negative; must be greater than 0"),
    ("URDF", "'URDF' is text; expected 'robot', 'none', a mapping, a number or"),
    ([1.0, 0], r"1: 0 is too small; must be greater than 0"),
    ([], "needs at least 1"),
    ([[1.0]], "expected a number"),
    (np.nan, "not a finite number"),
    ({"factor": 1}, r"unknown key 'factor' \(allowed: scale, joints\)"),
]
_WRONG_NUMBERS: list[tuple[Any, str]] = [
    ("robot", "'robot' is text; expected a number or a list of numbers"),
    (0.0, "must be greater than 0"),
    (np.inf, "not a finite number"),
    ([1.0, np.nan], "not a finite number"),
]
WRONG: dict[type[Part], dict[str, list[tuple[Any, str]]]] = {
    BallContact: {**_WRONG_CONTACT, "radius": [(-0.1, "-0.1 is negative")]},
    CommandedForce: {
        "value": [
            (None, "give either the value of the force or its trajectory"),
            ([1.0, 2.0], "it has 2 coordinates; needs 1"),
            ([0.0, np.inf, 1.0], "not a finite"),
        ],
        "trajectory": [
            (Hold([1.0]), "give either the value of the force or its trajectory"),
            ("hold", "expected a mapping"),
        ],
    },
    Limits: {
        "effort": _WRONG_MAXIMUM,
        "effort_rate": _WRONG_MAXIMUM,
        "velocity": _WRONG_MAXIMUM,
        "acceleration": _WRONG_NUMBERS,
        "position": [
            ((0.0, 1.0), "expected 'robot', 'none' or a mapping"),
            ({"lower": 1.0}, "missing key 'upper'"),
            ({"lower": 1.0, "upper": 0.0}, "lower must be below upper"),
            ({"joint": [0, 1]}, r"unknown key 'joint'; did you mean 'joints'\?"),
            ({"least": 0}, r"'least' \(allowed: lower, upper, joints\)"),
        ],
        "position_margin": [(-0.1, "must be at least 0")],
        "velocity_margin": [(1.0, "must be less than 1"), (-0.1, "at least 0")],
        "distances": [
            ([{"type": "obstacle"}], "0.type: unknown type 'obstacle'; did you mean"),
            ([{"type": "self", "least": 0.1}], "0.least: unknown key 'least'"),
            ([Sphere(0.1)], "distances"),
        ],
        "bandwidth": [(0.0, "must be greater than 0"), (True, "is a boolean")],
        "static_effort": [(0.0, "must be greater than 0"), (1.01, "must be at most 1")],
    },
    ObstacleDistance: {
        "minimum": [(-1.0, "-1.0 is negative; must be at least 0")],
        "obstacles": [
            ("ball", "expected a list"),
            ([], "needs at least 1"),
            ([3], "0"),
        ],
        "links": [([3], "3 is an integer; expected text")],
    },
    PointContact: {**_WRONG_CONTACT, "point": [([0, np.nan, 0], "not a finite")]},
    PositionRange: {
        "lower": [
            ("robot", "expected a number or a list of numbers"),
            ([0.0], "lower has 1 numbers and upper 2"),
            ([0.0, 2.0], "lower must be below upper"),
        ],
        "upper": [(np.nan, "not a finite number"), (-1.0, "lower must be below")],
    },
    ByJoint: {
        "joints": [
            ({}, "at least 1"),
            ({"a": 0.0}, "a: 0.0 is too small; must be greater than 0"),
            (20.0, "expected a mapping"),
        ]
    },
    PositionsByJoint: {
        "joints": [
            ({}, "at least 1"),
            ({"a": [1.0, 0.0]}, "joints.a: lower must be below upper; got 1.0, 0.0"),
            ({"a": [1.0]}, "a: .* has 1 entry, needs 2"),
            ({"a": [1.0, None]}, "a.1: nothing given; expected a number"),
        ]
    },
    Scaled: {
        "scale": [
            (0.0, "must be greater than 0"),
            ({}, "at least 1"),
            ({"a": -1.0}, "a: -1.0 is negative"),
            ("half", "expected a number or a mapping"),
        ]
    },
    SelfDistance: {"minimum": [(np.inf, "not a finite number")]},
    SlidingContact: {
        **_WRONG_CONTACT,
        "force": [(None, "a sliding contact needs the normal force")],
        "point": [([0, np.nan, 0], "not a finite")],
        "offset": [([0, 0], "has 2 entries, needs 3")],
        "smoothing": [(0.0, "must be greater than 0")],
    },
    SurfaceContact: {
        **_WRONG_CONTACT,
        "length": [(None, "give length and width"), (-1, "must be greater than 0")],
        "width": [(None, "give length and width"), (0, "must be greater than 0")],
        "center": [([0.0], "has 1 entry, needs 3")],
        "corners": [
            (TRIANGLE, "not both"),
            ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], "span no surface"),
            ([[0, 0, 0], [1, 1, 0]], "span no surface; needs three points or more"),
            ([[0, 0], [1, 0], [0, 1]], "has 2 entries, needs 3"),
        ],
    },
}
"""For each field, wrong values and what is said about them."""


def test_every_field_has_a_wrong_value() -> None:
    assert set(WRONG) == set(MEMBERS)
    for cls, fields in WRONG.items():
        assert set(fields) == {field.name for field in value_fields(cls)}, cls


@pytest.mark.parametrize(
    ("cls", "field", "value", "message"),
    [
        (cls, field, value, message)
        for cls, fields in WRONG.items()
        for field, wrong in fields.items()
        for value, message in wrong
    ],
)
def test_wrong_values_are_refused(
    cls: type[Part], field: str, value: Any, message: str
) -> None:
    with pytest.raises(cls.error, match=message) as raised:
        replace(EXAMPLES[cls], **{field: value})  # type: ignore[type-var]
    assert field in str(raised.value) or "sole" in str(raised.value)


def test_unknown_and_positional_arguments() -> None:
    with pytest.raises(contacts.Contact.error, match="missing key 'radius'"):
        BallContact("foot")  # type: ignore[call-arg]
    with pytest.raises(Limits.error, match="did you mean 'velocity'"):
        Limits(velocities=1.0)  # type: ignore[call-arg]
    with pytest.raises(Limits.error, match="arguments are given by name"):
        Limits(1.0)  # type: ignore[misc]
    with pytest.raises(Contact.error, match="expected text"):
        PointContact([0, 0, 0])  # type: ignore[misc]


def test_a_contact_has_the_name_of_its_frame() -> None:
    assert PointContact("foot").name == "foot"
    assert PointContact("foot", name="left foot").name == "left foot"
    assert repr(PointContact("foot", name="foot")) == "PointContact(frame='foot')"
    assert PointContact("foot", name="foot") == PointContact("foot")


def test_corners_of_a_rectangle() -> None:
    made = SurfaceContact("foot", length=0.2, width=0.1, center=[0.01, 0.0, -0.02])
    expected = [[x, y, -0.02] for x in (0.11, -0.09) for y in (0.05, -0.05)]
    np.testing.assert_allclose(made.points, expected, rtol=1e-15)
    center = [0.0, 0.0, 0.1]
    for options in ({"length": 0.1}, {"width": 0.1}, {"center": center}):
        with pytest.raises(Contact.error, match="not both"):
            SurfaceContact("foot", corners=TRIANGLE, **options)  # type: ignore[arg-type]
    with pytest.raises(Contact.error, match="give length and width of the sole"):
        SurfaceContact("foot")


@pytest.mark.parametrize("normal", [[0, 0, 1], [3, 0, 0], [0.1, -2, 5], [0, -1e-9, 0]])
def test_axes_of_a_plane(normal: list[float]) -> None:
    axes = PointContact("foot", normal=normal).axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(axes[:, 2], normal / np.linalg.norm(normal), atol=1e-15)


def test_when_a_contact_is_active() -> None:
    always = PointContact("foot")
    assert always.always
    assert always.active(-1e9)
    assert always.weight(1e9) == 1.0
    some = PointContact("foot", schedule=Schedule([(1.0, 2.0)], ramp=0.25))
    assert not some.always
    assert [some.active(t) for t in (0.9, 1.0, 1.9, 2.0)] == [False, True, True, False]
    assert some.weight(1.125) == pytest.approx(0.5)
    assert PointContact("foot", schedule=Schedule.always()).always
