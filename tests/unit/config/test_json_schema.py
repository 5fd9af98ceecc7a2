"""The JSON schema: complete texts, units, defaults that fit, one definition a part."""

import re
from collections.abc import Iterator
from typing import Any

import jsonschema
import pytest
from exported_schema import exported_schema, validator

from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import validate
from hsp_control.config.scenario import Scenario
from hsp_control.declaration.families import Family
from hsp_control.declaration.part import Part


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return exported_schema()


@pytest.fixture(scope="module")
def definitions(schema: dict[str, Any]) -> dict[str, Any]:
    return {"Scenario": schema, **schema["$defs"]}


@pytest.fixture(scope="module")
def properties(definitions: dict[str, Any]) -> list[tuple[str, Any]]:
    return [
        (f"{name}.{key}", about)
        for name, definition in definitions.items()
        for key, about in definition.get("properties", {}).items()
    ]


_SYMBOL = r"(?:rad|m|s|kg|N|Hz)[²³]?"
_PRODUCT = rf"(?:1|{_SYMBOL}(?:·{_SYMBOL})*)(?:/{_SYMBOL})?(?:/√Hz)?"
_WORDS = "control periods|periods|the task's unit(?: per s²?)?|unit quaternions"
_ONE = rf"(?:-|{_PRODUCT}|{_WORDS})"
UNIT = re.compile(rf"\[{_ONE}(?:(?:, or |, | or ){_ONE})*\]")
"""Such as [m], [N·m·s/rad or N·s/m], [rad/s/√Hz], [-]."""


def numeric(about: Any) -> bool:
    """Return whether a property may hold numbers itself, not inside another part."""
    if not isinstance(about, dict):
        return False
    inner = [about.get(key) for key in ("items", "additionalProperties")]
    for key in ("anyOf", "oneOf", "allOf", "prefixItems"):
        inner += about.get(key, [])
    inner += about.get("patternProperties", {}).values()
    return about.get("type") in ("number", "integer") or any(map(numeric, inner))


def test_everything_has_a_description(
    definitions: dict[str, Any], properties: list[tuple[str, Any]]
) -> None:
    assert [name for name, each in definitions.items() if "title" not in each] == []
    texts = {name: each.get("description") for name, each in definitions.items()}
    texts |= {name: about.get("description") for name, about in properties}
    assert [name for name, text in texts.items() if not text] == []
    assert [name for name, text in texts.items() if "TODO" in text] == []


def test_every_number_has_a_unit(properties: list[tuple[str, Any]]) -> None:
    without = [
        f"{name}: {about['description']}"
        for name, about in properties
        if numeric(about) and not UNIT.search(about["description"])
    ]
    assert without == []
    assert sum(numeric(about) for _, about in properties) > 200


@pytest.mark.parametrize(
    ("text", "has_one"),
    [
        ("Mass [kg].", True),
        ("Friction [N·m·s/rad or N·s/m], one number or nv.", True),
        ("A point [m, or the task's unit]; the start by default.", True),
        ("Weight [-].", True),
        ("Gravity, [0, 0, -9.81] by default.", False),
        ("Mass in kg.", False),
        ("Stiffness [-1/s²].", False),
    ],
)
def test_units(text: str, has_one: bool) -> None:
    assert bool(UNIT.search(text)) is has_one


def test_defaults_fit_their_own_schema(
    schema: dict[str, Any], properties: list[tuple[str, Any]]
) -> None:
    for name, about in properties:
        if "default" in about:
            own = {**about, "$defs": schema["$defs"]}
            found = list(jsonschema.Draft202012Validator(own).iter_errors(
                about["default"]
            ))  # fmt: skip
            assert not found, (name, about["default"])


def families() -> Iterator[Family]:
    """Yield the families whose parts YAML can give."""
    pending: list[type[Part]] = [Part]
    while pending:
        cls = pending.pop()
        pending += cls.__subclasses__()
        ours = cls.__module__.startswith("hsp_control.")
        if ours and cls.family is not None and cls.family.base is cls:
            yield cls.family


# -- names ----------------------------------------------------------------------------

TASK = {"type": "frame_position", "frame": "hand"}
NAMED = {**TASK, "name": "elbow"}


@pytest.mark.parametrize(
    ("tasks", "added", "good"),
    [
        (TASK, TASK, True),
        (TASK, NAMED, True),  # changes are a list: none has a key as its name
        (NAMED, NAMED, False),
        (TASK, {**NAMED, "frme": "hand"}, False),
    ],
)
def test_editor_and_program_agree_about_names(
    tasks: dict[str, Any], added: dict[str, Any], good: bool
) -> None:
    data = {
        "robot": {"name": "panda"},
        "tasks": {"hand": tasks},
        "changes": [{"type": "add_task", "at": 1, "task": added}],
    }
    assert validator().is_valid(data) is good
    try:
        scenario = validate(Document(data, {}, "data"), Scenario)
    except ValueError:
        assert not good
    else:
        assert good
        assert scenario.changes[0].task.name == added.get("name", "hand")
