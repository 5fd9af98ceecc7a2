"""Mistakes in the parts of a configuration: one message each, with its place."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import THOROUGH
from scenario_document import check_place, line_of
from wording import wording

from hsp_control import load_experiment
from hsp_control.common import errors
from hsp_control.common.errors import ConfigError, HspControlError
from hsp_control.common.resources import bundled_configs
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import validate
from hsp_control.config.scenario import Scenario
from hsp_control.config.yaml_reader import read_yaml
from hsp_control.declaration.located import KeyPath, written

BASE: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {"hand": {"type": "frame_position"}},
    "null_space": {"fields": [{"type": "rest"}]},
    "simulation": {"duration": 0.01},
}
TASKS = (
    "angular_momentum, center_of_mass, frame_orientation, frame_pose, frame_position, "
    "function_task, "
    "joint_posture, pointing, relative_pose"
)
GAINS = {"kp": 1, "kv": 1}
BOX = {"type": "box", "size": [1, 1, 1]}
HOLD = {"type": "hold", "point": [0, 0, 0]}


def task(**keys: Any) -> dict[str, Any]:
    """Return the section of tasks with one task."""
    return {"tasks": {"hand": {"type": "frame_position", **keys}}}


def field(**keys: Any) -> dict[str, Any]:
    """Return the section of the null space with one field."""
    return {"null_space": {"fields": [keys]}}


def scene(**keys: Any) -> dict[str, Any]:
    """Return the section of the scene with one obstacle."""
    return {"scene": {"obstacles": {"a": {"shape": BOX, "center": HOLD, **keys}}}}


def change(**keys: Any) -> dict[str, Any]:
    """Return the section of changes with one change, at 1 s."""
    return {"changes": [{"at": 1, **keys}]}


# Each row: the sections that are replaced, the class of the error, and its message.
MISTAKES: list[tuple[dict[str, Any], str, str]] = [
    ({"title": 301 * "t"}, "ConfigError",
     f"title: '{35 * 't'}...' ... 301 ... at most 300"),
    # colours: # begins a comment
    ({"view": {"background": None}}, "ConfigError",
     "view.background: nothing given ... in quotes"),
    ({"view": {"background": "blue"}}, "ConfigError",
     "view.background: 'blue' ... '#14202B'"),
    # types
    ({"tasks": {"hand": {"frame": "panda_hand"}}}, "ConfigError",
     "tasks.hand: missing ... 'type'"),
    ({"tasks": {"hand": {"tpye": "pointing"}}}, "ConfigError",
     "tasks.hand.tpye: unknown ... 'tpye' ... 'type'"),
    ({"tasks": {"hand": {"type": "pointng"}}}, "ConfigError",
     "tasks.hand.type: unknown ... 'pointng' ... 'pointing'"),
    ({"tasks": [{"type": "pointing"}]}, "ConfigError",
     "tasks: [{type: 'pointing'}] ... a mapping"),
    # keys
    (task(frme="a"), "ConfigError", "tasks.hand.frme: unknown ... 'frme' ... 'frame'"),
    (task(name="x"), "ConfigError", "tasks.hand.name: unknown ... 'hand' is the name"),
    (task(trajectory={"type": "circle", "radus": 1, "angular_rate": 1}), "ConfigError",
     "tasks.hand.trajectory.radus: unknown ... 'radus' ... 'radius'"),
    (task(trajectory={"type": "line"}), "ConfigError",
     "tasks.hand.trajectory: missing ... 'end', 'duration'"),
    (scene(name="b"), "ConfigError",
     "scene.obstacles.a.name: unknown ... 'a' is the name"),
    ({"scene": {"obstacles": {"": {"shape": BOX, "center": HOLD}}}}, "ConfigError",
     "scene.obstacles.'': ... at least 1"),
    ({"tasks": {"ha:nd": {"type": "frame_position"}}}, "TaskError",
     "tasks.'ha:nd': ... letters, digits, '_' and '-'"),
    # where they belong
    ({"obstacles": {"a": {"shape": BOX, "center": HOLD}}}, "ConfigError",
     "obstacles: unknown ... belongs to 'scene'"),
    ({"robot": "panda"}, "ConfigError", "robot: ... did you mean {name: panda}?"),
    ({"duration": 3}, "ConfigError", "duration: unknown ... belongs to 'simulation'"),
    ({"natural_frequency": 3}, "ConfigError",
     "natural_frequency: unknown ... to 'tasks.*.gains', ... or to 'live.stop'"),
    ({"blend": 1}, "ConfigError", "blend: unknown ... belongs to 'tasks.*' or"),
    ({"null_space": {"weight": 2}}, "ConfigError",
     "null_space.weight: unknown ... belongs to 'null_space.fields.*' or"),
    (task(kp=100), "ConfigError",
     "tasks.hand.kp: unknown ... belongs to 'tasks.hand.gains'"),
    (task(metric="mass_matrix"), "ConfigError",
     "tasks.hand.metric: ... belongs to 'null_space'"),
    (task(gains={"kp": 1, "kv": 1, "blend": 2}), "ConfigError",
     "tasks.hand.gains.blend: unknown ... belongs beside 'gains'"),
    ({"kp": 100}, "ConfigError", "kp: unknown ... to 'tasks.*.gains' or to 'changes"),
    ({"simulation": {"limits": {}}}, "ConfigError",
     "simulation.limits: ... belongs beside 'simulation' or"),
    ({"radius": 1}, "ConfigError", "radius: unknown key 'radius' (allowed"),
    # values
    (task(gains={"kp": [1, [2]], "kv": 1}), "ConfigError",
     "tasks.hand.gains.kp.1: [2] ... a number"),
    (task(trajectory={"type": "hold", "point": [1, float("nan"), 2]}), "ConfigError",
     "tasks.hand.trajectory.point.1: .nan ... finite"),
    ({"null_space": {"fields": {"type": "rest"}}}, "ConfigError",
     "null_space.fields: {type: 'rest'} ... a list of mappings"),
    (scene(orientation={"type": "spin", "axis": [0, 0, 0], "rate": 1}),
     "TrajectoryError",
     "scene.obstacles.a.orientation: axis ... non-zero ... [0, 0, 0]"),
    # changes
    (change(type="gains", task="hnd", gains=GAINS), "ControllerError",
     "changes.0.task: there is no ... 'hnd' ... 'hand'"),
    (change(type="gains", task="hand", gains={"kp": [1, 1], "kv": 1}), "GainError",
     "changes.0.gains: kp ... (2,) ... a number"),
    (change(type="add_task", task={"type": "pointing", "frame": "panda_hnd",
                                   "direction": [0, 0, 1]}), "FrameNotFoundError",
     "changes.0.task.frame: no ... 'panda_hnd' ... 'panda_hand'"),
    (change(type="add_task", task={"type": "frame_position", "name": "hand"}),
     "ControllerError",
     "changes.0.task: two tasks ... 'hand'"),
    (change(type="field", fields=[{"type": "joint_centering", "weights": [1, 1]}]),
     "FieldError",
     "changes.0.fields.0.weights: weights ... (2,) ... one number"),
    (change(type="null_space_gain", gain=[1, 2]), "GainError",
     "changes.0.gain: null_space_gain ... (2,) ... a number"),
    (change(type="contact", contact="a", active=True), "ControllerError",
     "changes.0.contact: there is no contact 'a'"),
    ({"changes": [
        {"type": "remove_task", "task": "hand", "at": 2},
        {"type": "gains", "task": "hand", "gains": GAINS, "at": 3},
     ]}, "ControllerError", "changes.1.task: there is no task 'hand'"),
    ({"changes": [
        {"type": "gains", "task": "hand", "gains": GAINS, "at": 3},
        {"type": "remove_task", "task": "hand", "at": 2},
     ]}, "ControllerError", "changes.0.task: there is no task 'hand'"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("sections", "error", "message"),
    MISTAKES,
    ids=[f"{k}-{message[:30]}" for k, (_, _, message) in enumerate(MISTAKES)],
)
def test_every_mistake_is_named(
    sections: dict[str, Any], error: str, message: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({**BASE, **sections}, sort_keys=False))
    with pytest.raises(getattr(errors, error)) as caught:
        load_experiment(file)
    assert type(caught.value) is getattr(errors, error)
    check_place(caught.value, file)
    _, _, text = str(caught.value).removeprefix(f"{file}:").partition(": ")
    assert re.search(wording(message), text)


# -- any mistake in any bundled configuration -----------------------------------------

WRONG: dict[str, Any] = {
    "text": "nonsense",
    "number": -1.5,
    "nan": float("nan"),
    "true": True,
    "nothing": None,
    "no list": [],
    "no mapping": {},
    "lists": [[[]]],
    "mapping": {"nonsense": 1},
}
FOREIGN = ("instance", "should be", "Input", "Sequence", "dataclass", "function-")
"""Words that only pydantic uses."""


def inner_paths(value: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the key paths of a value, outermost first."""
    entries: Any = ()
    if isinstance(value, dict):
        entries = value.items()
    elif isinstance(value, list):
        entries = enumerate(value)
    for key, inner in entries:
        yield (*path, key)
        yield from inner_paths(inner, (*path, key))


def holder_of(data: Any, path: KeyPath) -> Any:
    """Return the mapping or list that has the last key of the path."""
    for key in path[:-1]:
        data = data[key]
    return data


def mistakes(data: Any, path: KeyPath) -> Iterator[tuple[str, Any, str]]:
    """Yield a mistake's name, the data with it, and its key path."""
    for what, value in WRONG.items():
        wrong = json.loads(json.dumps(data))
        holder_of(wrong, path)[path[-1]] = value
        yield what, wrong, written(path)
    if isinstance(path[-1], str):
        wrong = json.loads(json.dumps(data))
        del holder_of(wrong, path)[path[-1]]
        yield "missing", wrong, written(path[:-1])
        misspelt = f"{path[-1]}x"
        holder_of(wrong, path)[misspelt] = holder_of(data, path)[path[-1]]
        yield "misspelt", wrong, written((*path[:-1], misspelt))


def kinds(data: Any) -> dict[Any, KeyPath]:
    """Return one key path per kind: the type that holds it, and its last keys."""
    found: dict[Any, KeyPath] = {}
    for path in inner_paths(data):
        holder = holder_of(data, path)
        kind = holder.get("type") if isinstance(holder, dict) else None
        last = tuple("*" if isinstance(key, int) else key for key in path[-3:])
        found.setdefault((path[0], kind, last), path)
    return found


def together(error: HspControlError, path: KeyPath) -> bool:
    """Whether an error may be about a whole part, or a whole array."""
    return type(error) is not ConfigError or isinstance(path[-1], int)


def refusal(document: Document) -> HspControlError | None:
    """Return the error that a document raises, or None."""
    try:
        validate(document, Scenario)
    except HspControlError as error:
        return error
    return None


@pytest.mark.slow
def test_any_mistake_in_any_configuration_is_named_at_its_place() -> None:
    seen: set[Any] = set()
    refused = 0
    texts = {
        name: file.read_text(encoding="utf-8")
        for name, file in bundled_configs().items()
    }
    # Each kind is taken from the shortest text that has it: it is read fastest.
    for name, text in sorted(texts.items(), key=lambda each: len(each[1])):
        data, marks = read_yaml(text)
        for kind, path in kinds(data).items():
            if kind in seen:
                continue
            seen.add(kind)
            # A tenth of the mistakes of each kind; another tenth of the next.
            some = slice(None) if THOROUGH else slice(len(seen) % 10, None, 10)
            for what, wrong, expected in [*mistakes(data, path)][some]:
                error = refusal(Document(wrong, marks, "file"))
                if error is None:
                    continue
                refused += 1
                first = str(error).splitlines()[0]
                where, at, _ = first.split(": ", 2)
                at = at if expected else ""
                case = (name, what, expected, first)
                assert f"{at}.".startswith(f"{expected}.") or (
                    together(error, path) and expected.startswith(f"{at}.")
                ), case
                assert not any(word in first for word in FOREIGN), case
                if what != "misspelt":
                    assert where == f"file:{line_of(text, at)}", case
    assert refused > (3000 if THOROUGH else 300)
