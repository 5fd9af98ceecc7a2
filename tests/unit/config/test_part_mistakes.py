"""Mistakes in the parts of a configuration: one message each, with its place."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import THOROUGH
from scenario_document import check_place, line_of

from hsp_control import load_experiment
from hsp_control.common import exceptions
from hsp_control.common.exceptions import ConfigError, HspControlError
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
     f"title: '{35 * 't'}...' has 301 characters, needs at most 300"),
    # colours: # begins a comment
    ({"view": {"background": None}}, "ConfigError",
     "view.background: nothing given; write a colour in quotes, \"#14202B\": "
     "# begins a comment"),
    ({"view": {"background": "blue"}}, "ConfigError",
     "view.background: 'blue' is not a colour, such as '#14202B'"),
    # types
    ({"tasks": {"hand": {"frame": "panda_hand"}}}, "ConfigError",
     f"tasks.hand: missing key 'type'; type is one of: {TASKS}"),
    ({"tasks": {"hand": {"tpye": "pointing"}}}, "ConfigError",
     "tasks.hand.tpye: unknown key 'tpye'; did you mean 'type'? (type is one of: "
     f"{TASKS})"),
    ({"tasks": {"hand": {"type": "pointng"}}}, "ConfigError",
     "tasks.hand.type: unknown type 'pointng'; did you mean 'pointing'? (allowed: "
     f"{TASKS})"),
    ({"tasks": [{"type": "pointing"}]}, "ConfigError",
     "tasks: [{type: 'pointing'}] is a list; expected a mapping"),
    # keys
    (task(frme="a"), "ConfigError",
     "tasks.hand.frme: unknown key 'frme'; did you mean 'frame'? (allowed: type, "
     "priority, schedule, gains, largest_error, impedance, blend, frame, trajectory, "
     "axes)"),
    (task(name="x"), "ConfigError",
     "tasks.hand.name: unknown key 'name'; the key 'hand' is the name"),
    (task(trajectory={"type": "circle", "radus": 1, "angular_rate": 1}), "ConfigError",
     "tasks.hand.trajectory.radus: unknown key 'radus'; did you mean 'radius'? "
     "(allowed: type, origin, radius, angular_rate, center, phase, normal, toward, "
     "axes)"),
    (task(trajectory={"type": "line"}), "ConfigError",
     "tasks.hand.trajectory: missing keys 'end', 'duration'; required here: type, end, "
     "duration"),
    (scene(name="b"), "ConfigError",
     "scene.obstacles.a.name: unknown key 'name'; the key 'a' is the name"),
    ({"scene": {"obstacles": {"": {"shape": BOX, "center": HOLD}}}}, "ConfigError",
     "scene.obstacles.'': the key '' should have at least 1 character"),
    ({"tasks": {"ha:nd": {"type": "frame_position"}}}, "TaskError",
     "tasks.'ha:nd': task name 'ha:nd': use letters, digits, '_' and '-' (the columns "
     "of the log contain it)"),
    # values
    (task(gains={"kp": [1, [2]], "kv": 1}), "ConfigError",
     "tasks.hand.gains.kp.1: [2] is a list; expected a number"),
    (task(trajectory={"type": "hold", "point": [1, float("nan"), 2]}), "ConfigError",
     "tasks.hand.trajectory.point.1: .nan is not a finite number"),
    ({"null_space": {"fields": {"type": "rest"}}}, "ConfigError",
     "null_space.fields: {type: 'rest'} is a mapping; expected a list of mappings"),
    (scene(orientation={"type": "spin", "axis": [0, 0, 0], "rate": 1}),
     "TrajectoryError",
     "scene.obstacles.a.orientation: axis must be non-zero; axis = [0, 0, 0]"),
    # changes
    (change(type="gains", task="hnd", gains=GAINS), "ControllerError",
     "changes.0: there is no task 'hnd'; did you mean 'hand'? (there are hand)"),
    (change(type="gains", task="hand", gains={"kp": [1, 1], "kv": 1}), "GainError",
     "changes.0.gains: kp has shape (2,); needs a number, 3 numbers or a 3 × 3 matrix"),
    (change(type="add_task", task={"type": "pointing", "frame": "panda_hnd",
                                   "direction": [0, 0, 1]}), "FrameNotFoundError",
     "changes.0.task.frame: no frame 'panda_hnd'; did you mean 'panda_hand'? (the "
     "model has "),
    (change(type="add_task", task={"type": "frame_position", "name": "hand"}),
     "ControllerError",
     "changes.0: two tasks are called 'hand'; give them distinct names"),
    (change(type="field", fields=[{"type": "joint_centering", "weights": [1, 1]}]),
     "FieldError",
     "changes.0.fields.0.weights: weights have shape (2,); needs one number or 7"),
    (change(type="null_space_gain", gain=[1, 2]), "GainError",
     "changes.0.gain: null_space_gain has shape (2,); needs a number, 7 numbers or a "
     "7 × 7 matrix"),
    (change(type="contact", contact="a", active=True), "ControllerError",
     "changes.0: there is no contact 'a' (there are none)"),
    ({"changes": [
        {"type": "remove_task", "task": "hand", "at": 2},
        {"type": "gains", "task": "hand", "gains": GAINS, "at": 3},
     ]}, "ControllerError", "changes.1: there is no task 'hand' (there are none)"),
    ({"changes": [
        {"type": "gains", "task": "hand", "gains": GAINS, "at": 3},
        {"type": "remove_task", "task": "hand", "at": 2},
     ]}, "ControllerError", "changes.0: there is no task 'hand' (there are none)"),
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
    with pytest.raises(getattr(exceptions, error)) as caught:
        load_experiment(file)
    assert type(caught.value) is getattr(exceptions, error)
    check_place(caught.value, file)
    _, _, text = str(caught.value).removeprefix(f"{file}:").partition(": ")
    assert text.startswith(message) if message.endswith(" ") else text == message


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
"""Words of pydantic."""


def inner_paths(value: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the key paths of a value, from the outside."""
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
    """Yield what is wrong, the data with it, and the key path that it is at."""
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
    """Return one key path of each kind: the type of its holder, and its last keys."""
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
    """Return the error of a document, if it has mistakes."""
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
    # Each kind in the shortest text that has it, which is read soonest.
    for name, text in sorted(texts.items(), key=lambda each: len(each[1])):
        data, marks = read_yaml(text)
        for kind, path in kinds(data).items():
            if kind in seen:
                continue
            seen.add(kind)
            # A fifth of the mistakes of each kind; another fifth of the next.
            some = slice(None) if THOROUGH else slice(len(seen) % 5, None, 5)
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
    assert refused > (3000 if THOROUGH else 600)
