"""Mistakes in contacts, limits, priorities and the base: one located message."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from scenario_document import check_place
from wording import wording

from hsp_control import load_experiment
from hsp_control.common import errors

pytest.importorskip("example_robot_data")

FEET = {"front_left": "FL", "front_right": "FR", "hind_left": "HL", "hind_right": "HR"}
HOLD = {"type": "frame_position", "trajectory": {"type": "hold"}}
SOLO: dict[str, Any] = {
    "robot": {"name": "solo12"},
    "start": {"ground": 0},
    "contacts": {
        name: {"type": "ball", "frame": f"{foot}_FOOT", "radius": 0.0165}
        for name, foot in FEET.items()
    },
    "tasks": {"trunk": {**HOLD, "frame": "base_link"}},
    "simulation": {"duration": 0.01, "control_period": 0.001},
}
PANDA: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {"hand": HOLD},
    "limits": {},
    "simulation": {"duration": 0.01},
}
SOLE = {"type": "surface", "frame": "FL_FOOT"}
LINE = [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]
FOOT = "contacts.front_left"
TWICE = {"intervals": [[0, 2], [1, 3]]}
REMOVED = object()

# Each row: the robot, the changed value, the class of the error, and its message.
MISTAKES: list[tuple[dict[str, Any], str, Any, str, str]] = [
    (SOLO, f"{FOOT}.frame", "FL_FOT", "FrameNotFoundError",
     f"{FOOT}.frame: no ... 'FL_FOT' ... 'FL_FOOT'"),
    (SOLO, f"{FOOT}.normal", [0, 0, 0], "ContactError",
     f"{FOOT}.normal: [0.0, 0.0, 0.0] ... not be zero"),
    (SOLO, FOOT, {**SOLE, "type": "sphere"}, "ConfigError",
     f"{FOOT}.type: unknown ... 'sphere'"),
    (SOLO, FOOT, SOLE, "ContactError", f"{FOOT}: ... length and width ... corners"),
    (SOLO, FOOT, {**SOLE, "corners": LINE}, "ContactError",
     f"{FOOT}.corners: [[0.0, 0.0, 0.0], ... three points"),
    (SOLO, f"{FOOT}.schedule", TWICE, "ScheduleError",
     f"{FOOT}.schedule: ... 1 to 3 s overlaps"),
    (SOLO, f"{FOOT}.schedule", {"intervals": [[0, 1]], "ramp": 2}, "ScheduleError",
     f"{FOOT}.schedule: ... 0 to 1 s is shorter ... 4 s"),
    (SOLO, "contacts", {}, "ContactError",
     "start.ground: solo12 has no contact"),
    (SOLO, "base", "driven", "ContactError", "base: ... 'driven' ... no contacts"),
    (PANDA, "base", "flying", "ContactError",
     "base: panda has no free-flyer root"),
    (PANDA, "contacts", {"hand": {"type": "sliding", "frame": "panda_tcp"}},
     "ContactError", "contacts.hand.force: ... missing"),
    (PANDA, "start", {"ground": 0}, "ContactError",
     "start.ground: panda has no free-flyer root"),
    (PANDA, "limits.effort", {"scale": {"panda_joint9": 0.5}}, "JointNotFoundError",
     "limits.effort.scale.panda_joint9: no ... 'panda_joint9'"),
    (SOLO, "limits", {"effort": {"scale": {"root_joint": 0.5}}}, "LimitError",
     "limits.effort.scale.root_joint: ... no limit"),
    (PANDA, "limits.effort", [1, 2], "LimitError",
     "limits.effort: ... 2 numbers ... 7"),
    (PANDA, "limits.effort", "robt", "ConfigError",
     "limits.effort: 'robt' ... 'robot'"),
    (PANDA, "limits.position", {"lower": [0] * 7, "upper": [0] * 7}, "LimitError",
     "limits.position: lower ... below upper"),
    (PANDA, "limits.position", {"lower": [-1] * 7, "upper": [1] * 6}, "LimitError",
     "limits.position: lower has 7 ... upper 6"),
    (PANDA, "limits.position", {"lower": -1, "upper": [1] * 6}, "LimitError",
     "limits.position.upper: ... 6 numbers ... 7"),
    (PANDA, "limits.position_margin", 4, "LimitError",
     "limits.position: ... panda_joint1 ... -2.8973 to 2.8973 ... 4"),
    (PANDA, "limits.barriers", [{"type": "self_distnce"}], "ConfigError",
     "limits.barriers.0.type: unknown ... 'self_distnce' ... 'self_dist"),
    (PANDA, "limits.barriers", [{"type": "obstacle_distance", "obstacles": ["ball"]}],
     "SceneError",
     "limits.barriers.0.obstacles.0: no obstacle 'ball'"),
    (PANDA, "limits.position", {"lower": [-3] * 7, "upper": [-1] * 7}, "LimitError",
     "start: ... panda_joint1 is at 0"),
    (PANDA, "start", {"joints": {"panda_joint4": 0.1}}, "LimitError",
     "start: ... panda_joint4 is at 0.1"),
]  # fmt: skip


def changed(base: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Return a configuration with one value changed, made or removed."""
    data: dict[str, Any] = json.loads(json.dumps(base))
    *keys, last = path.split(".")
    place = data
    for key in keys:
        place = place[key]
    if value is REMOVED:
        del place[last]
    else:
        place[last] = value
    return data


def check(data: dict[str, Any], error: str, message: str, file: Path) -> None:
    """The message names the file, the line, and the wrong value."""
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(getattr(errors, error)) as caught:
        load_experiment(file)
    assert re.search(wording(f"... {message}"), str(caught.value))
    path = message.partition(": ")[0]
    assert check_place(caught.value, file) == ("" if " " in path else path)


@pytest.mark.parametrize(
    ("base", "path", "value", "error", "message"),
    MISTAKES,
    ids=[f"{path}-{k}" for k, (_, path, *_) in enumerate(MISTAKES)],
)
def test_every_mistake_is_named(
    base: dict[str, Any],
    path: str,
    value: Any,
    error: str,
    message: str,
    tmp_path: Path,
) -> None:
    check(changed(base, path, value), error, message, tmp_path / "mine.yaml")
