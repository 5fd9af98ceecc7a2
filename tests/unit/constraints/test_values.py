"""Contacts and limits are values; the classes are found by reflection."""

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from values import assert_is_a_value

import hsp_control.constraints.contacts as contacts
import hsp_control.constraints.limits as limits
from hsp_control import Hold, Obstacle, Sphere
from hsp_control.constraints.contacts import (
    BallContact,
    CommandedForce,
    Contact,
    PointContact,
    SlidingContact,
    SurfaceContact,
)
from hsp_control.constraints.limits import (
    Barrier,
    ByJoint,
    Limits,
    ObstacleDistance,
    PositionRange,
    PositionsByJoint,
    Scaled,
    SelfDistance,
)
from hsp_control.declaration import Part
from hsp_control.trajectories import Schedule

NAMES: dict[str, Any] = {
    name: each
    for module in (contacts, limits)
    for name, each in vars(module).items()
    if inspect.isclass(each)
} | {each.__name__: each for each in (Hold, Obstacle, Schedule, Sphere)}
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
"""One instance of each class."""

TRIED = [
    *EXAMPLES.values(),
    PointContact(
        "hand", normal=np.array([0.1, 0.0, 2.0]), damping=10, point=(0.1, 0, 0.0)
    ),
    PointContact("hand", schedule=Schedule([(1.0, None)]), force=CommandedForce(5.0)),
    SurfaceContact("foot", corners=TRIANGLE),
    CommandedForce(np.array([0, 0, 9, 0, 0, 1.0])),
    CommandedForce(trajectory=Hold([20.0])),
    Limits(effort="none", velocity=Scaled({"b": 0.5, "a": 2}), position="none"),
    Limits(effort=np.ones(7), acceleration=[3.0, None], static_effort=1),
    Limits(position=PositionRange(-1.0, [1.0, None]), effort=ByJoint({"b": 5, "a": 2})),
    Limits(barriers=(ObstacleDistance(0.1, obstacles=[BALL]), SelfDistance(0.0))),
]
"""Values that are given in another form are converted."""


@pytest.mark.parametrize("part", TRIED, ids=repr)
def test_they_are_values(part: Part) -> None:
    assert_is_a_value(part, NAMES)
    assert [each == part for each in TRIED].count(True) == 1
    if isinstance(part, Contact):
        assert not part.points.flags.writeable
        assert not part.axes.flags.writeable


@pytest.mark.parametrize(
    ("family", "data", "part"),
    [
        (
            Contact,
            {"type": "point", "frame": "a", "schedule": {"intervals": [[None, 1.0]]}},
            PointContact("a", schedule=Schedule([(None, 1.0)])),
        ),
        (
            Barrier,
            {"type": "obstacle_distance", "obstacles": ["a"], "links": ["b"]},
            ObstacleDistance(obstacles=["a"], links=["b"]),
        ),
    ],
)
def test_as_in_yaml(family: type[Part], data: dict[str, Any], part: Part) -> None:
    assert TypeAdapter(family).validate_python(data) == part


def test_limits_from_yaml() -> None:
    data: dict[str, Any] = {
        "effort": {"scale": {"a": 0.5}},
        "velocity": {"joints": {"a": 2}},
        "effort_rate": 1000,
        "acceleration": [1, None],
        "position": {"lower": [-1, None], "upper": [1, 2]},
        "barriers": [
            {"type": "self_distance"},
            {"type": "obstacle_distance", "minimum": 0.1},
        ],
    }
    assert Limits(**data) == Limits(
        effort=Scaled({"a": 0.5}),
        velocity=ByJoint({"a": 2.0}),
        effort_rate=1000.0,
        acceleration=[1.0, np.inf],
        position=PositionRange([-1.0, -np.inf], [1.0, 2.0]),
        barriers=(SelfDistance(), ObstacleDistance(0.1)),
    )


# --- refusals -----------------------------------------------------------------------

WRONG: dict[type[Part], list[tuple[str, Any, str]]] = {
    PointContact: [
        ("frame", 3, "3 is an int; expected a str"),
        ("friction", 0.0, "must be greater than 0"),
        ("normal", [0, 0, 0], r"\[0.0, 0.0, 0.0\] has no direction; must not be zero"),
        ("normal", [1e-200, 1e-200, 0], "has no direction"),
        ("schedule", "always", "needs a Schedule"),
        ("force", 20.0, "needs a CommandedForce"),
        ("point", [0, np.nan, 0], "not a finite"),
    ],
    BallContact: [("radius", -0.1, "-0.1 is negative")],
    CommandedForce: [
        ("value", None, "give either the value of the force or its trajectory"),
        ("value", [1.0, 2.0], "it has 2 coordinates; needs 1"),
        ("trajectory", Hold([1.0]), "give either the value of the force or its traj"),
    ],
    Limits: [
        ("effort", -1.0, "-1.0 is negative; must be greater than 0"),
        ("effort_rate", "URDF", "'URDF' is a str; expected 'robot', 'none', a dict"),
        ("velocity", {"factor": 1}, r"unknown key 'factor' \(allowed: scale, joints\)"),
        (
            "acceleration",
            "robot",
            "'robot' is a str; expected a number or a list of nu",
        ),
        ("acceleration", [1.0, np.nan], "not a finite number"),
        ("position", (0.0, 1.0), "expected 'robot', 'none' or a dict"),
        ("position", {"lower": 1.0}, "missing key 'upper'"),
        ("position", {"joint": [0, 1]}, r"'joint'; did you mean 'joints'\?"),
        ("position", {"least": 0}, r"'least' \(allowed: lower, upper, joints\)"),
        ("position_margin", -0.1, "must be at least 0"),
        ("velocity_margin", 1.0, "must be less than 1"),
        ("barriers", [{"type": "obstacle"}], "0.type: unknown type 'obstacle'; did"),
        ("barriers", [Sphere(0.1)], "barriers"),
        ("bandwidth", 0.0, "must be greater than 0"),
        ("static_effort", 1.01, "must be at most 1"),
    ],
    ObstacleDistance: [
        ("minimum", -1.0, "-1.0 is negative; must be at least 0"),
        ("obstacles", [], "needs at least 1"),
    ],
    PositionRange: [
        ("lower", [0.0], "lower has 1 numbers and upper 2"),
        ("lower", [0.0, 2.0], "lower must be below upper"),
    ],
    ByJoint: [
        ("joints", {}, "at least 1"),
        ("joints", {"a": 0.0}, "a: 0.0 is too small; must be greater than 0"),
    ],
    PositionsByJoint: [
        ("joints", {"a": [1.0, 0.0]}, "joints.a: lower must be below upper; got 1.0"),
        ("joints", {"a": [1.0, None]}, "a.1: None; expected a number"),
    ],
    Scaled: [
        ("scale", {"a": -1.0}, "a: -1.0 is negative"),
        ("scale", "half", "expected a number or a dict"),
    ],
    SlidingContact: [
        ("force", None, "a sliding contact needs the normal force"),
        ("offset", [0, 0], "has 2 entries, needs 3"),
        ("smoothing", 0.0, "must be greater than 0"),
    ],
    SurfaceContact: [
        ("length", None, "give length and width"),
        ("width", 0, "must be greater than 0"),
        ("corners", TRIANGLE, "not both"),
    ],
}


@pytest.mark.parametrize(
    ("cls", "field", "value", "message"),
    [(cls, *wrong) for cls, each in WRONG.items() for wrong in each],
)
def test_wrong_values_are_refused(
    cls: type[Part], field: str, value: Any, message: str
) -> None:
    with pytest.raises(cls.error, match=message) as raised:
        replace(EXAMPLES[cls], **{field: value})  # type: ignore[type-var]
    assert field in str(raised.value) or "sole" in str(raised.value)


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
