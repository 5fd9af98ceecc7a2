"""Overrides, and the location of errors that are raised after reading."""

import pickle
import re

import pytest
from scenario_document import GOOD, Gains, Scenario, message
from wording import wording

from hsp_control.common.errors import FrameNotFoundError
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import validate
from hsp_control.declaration.language import in_yaml

# --- overrides -----------------------------------------------------------------------


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
    assert document.location(kp) == "'tasks.hand.gains.kp=[1e2, 2]'"
    assert document.location((*kp, 1)) == "'tasks.hand.gains.kp=[1e2, 2]'"
    assert document.mark(kp) is None
    assert document.location(kp[:-1]) == "panda.yaml:5"
    assert document.location(("steps",)) == "'steps=3'"


def test_overrides_create_mappings_and_fill_empty_ones() -> None:
    document = Document.parse("a:\nb: [~]")
    document.override("a.b.c=")
    document.override("b.0.c=d")
    assert document.to_dict() == {"a": {"b": {"c": None}}, "b": [{"c": "d"}]}
    assert document.location(("a", "b")) == "'a.b.c='"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("steps", "... key=value ... tasks.0.gains.kp=100"),
        ("=3", "... key=value"),
        ("a..b=3", "... key=value"),
        ("robot.name=3", "robot is 'panda' ... no keys"),
        ("fields.2.weight=3", "fields has no entry '2' (entries: 0 to 1)"),
        ("fields.-1.weight=3", "fields has no entry '-1' (entries: 0 to 1)"),
        ("fields.first=3", "fields has no entry 'first' (entries: 0 to 1)"),
        ("fields.0=[1,", "not YAML: ... expected ... '<stream end>'"),
        ("steps=!!x 1", "... '!!x' is not allowed"),
        ("steps=a\nb: 1", "not YAML: a key is not allowed ... quotes"),
        ("steps=x", "steps: 'x' ... an integer"),
        ("fields.0.wieght=1", "fields.0.wieght: unknown ... 'wieght' ... 'weight'"),
        ("fields.1={type: x}", "fields.1.type: unknown ... 'x'"),
        ("tasks.foot.gains.kp=1", "tasks.foot: missing ... 'frame'"),
    ],
)  # fmt: skip
def test_mistakes_in_overrides(override: str, expected: str) -> None:
    words = " ".join(override.split())
    with in_yaml():
        assert re.search(wording(f"--set {words}: {expected}"), message(GOOD, override))
    assert re.search(wording(f"{words!r}: {expected}"), message(GOOD, override))


def test_mistakes_of_overrides_come_last() -> None:
    reported = (
        "panda.yaml:2: view: 3 ... and 1 more: ... 'steps=x': steps: 'x' ... integer"
    )
    assert re.search(wording(reported), message("robot: a\nview: 3", "steps=x"))


# --- errors raised later -------------------------------------------------------------


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
