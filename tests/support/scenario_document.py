"""A small schema and a valid text, for tests of reading documents."""

import re
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import pytest
import yaml
from pydantic import BaseModel, ConfigDict, Field, RootModel, model_validator

from hsp_control.common.errors import ConfigError
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import validate

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    """The base of all parts of the small schema below."""

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
robot: panda   # comments are ignored
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
    """Return the message of the only error of a text."""
    with pytest.raises(ConfigError) as caught:
        read(text, *overrides, model=model)
    return str(caught.value)


@cache
def _composed(text: str) -> yaml.Node:
    return yaml.compose(text)


def line_of(text: str, path: str) -> int:
    """Return the line of a key path in a YAML text, or of its nearest ancestor."""
    node = _composed(text)
    line = node.start_mark.line + 1
    for quoted in re.findall(r"'[^']*'|[^.]+", path):
        part = quoted.strip("'")
        if isinstance(node, yaml.MappingNode):
            entries = {key.value: (key, value) for key, value in node.value}
        elif isinstance(node, yaml.SequenceNode):
            entries = {str(k): (each, each) for k, each in enumerate(node.value)}
        else:
            break
        if part not in entries:
            break
        place, node = entries[part]
        line = place.start_mark.line + 1
    return line


def check_place(error: Exception, file: Path) -> str:
    """Check that an error is one line with the right location; return the key path."""
    where, _, rest = str(error).removeprefix(f"{file}:").partition(": ")
    path, colon, _ = rest.partition(": ")
    if not colon or " " in path:
        path = ""
    assert str(error).startswith(f"{file}:{line_of(file.read_text(), path)}: "), error
    assert where.isdecimal()
    assert "\n" not in str(error), error
    return path
