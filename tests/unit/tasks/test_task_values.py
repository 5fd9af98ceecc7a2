"""Tasks and gains are values; the classes are found by reflection."""

import inspect
import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from pinocchio import SE3, Quaternion, SE3ToXYZQUAT
from task_cases import placed
from values import assert_is_a_value
from wording import wording

import hsp_control.tasks as tasks
import hsp_control.trajectories as paths
from hsp_control import (
    CenterOfMass,
    Circle,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Line,
    Obstacle,
    Pointing,
    Robot,
    Sphere,
    Task,
)
from hsp_control.declaration import Part
from hsp_control.declaration.families import value_fields
from hsp_control.tasks import AngularMomentum, FunctionTask, Impedance, RelativePose
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    HoldPose,
    Schedule,
    ScrewInterpolation,
    Spin,
)

NAMES: dict[str, Any] = {**vars(paths), **vars(tasks)}
CLASSES = [
    each
    for each in vars(tasks).values()
    if inspect.isclass(each) and issubclass(each, Part) and each is not FunctionTask
]
MEMBERS = [each for each in CLASSES if not inspect.isabstract(each)]
EXAMPLES: dict[type[Part], Part] = {
    AngularMomentum: AngularMomentum(),
    CenterOfMass: CenterOfMass(),
    FrameOrientation: FrameOrientation(),
    FramePose: FramePose(),
    FramePosition: FramePosition(),
    Gains: Gains(4.0, 5.0),
    Impedance: Impedance(100.0),
    JointPosture: JointPosture(),
    Pointing: Pointing(direction=[0, 0, 1]),
    RelativePose: RelativePose(reference="panda_link0"),
}
"""One instance of each class, with required arguments only."""

_TASK: dict[str, Any] = {
    "priority": 2,
    "schedule": Schedule([(1.0, None)]),
    "name": "mine",
}
_GAINS: dict[str, Any] = {
    "gains": Gains(natural_frequency=[1, 2, 3]),
    "largest_error": [0.2, "none", None, [0.1, None], np.array([0.1, 0.3])],
}
_TRACKING: dict[str, Any] = {**_TASK, **_GAINS, "blend": 2}
_SPRING: dict[str, Any] = {
    "impedance": [Impedance([100, 200, 300]), Impedance(50, damping=20)]
}
_FRAME: dict[str, Any] = {"frame": "panda_hand"}
_POINT = [Hold([0.1, 0, 0]), Circle(0.1, 2), Line([1, 2, 3], 1.0, origin="start")]
_TURN = [Spin([0, 0, 1], 0.5), HoldOrientation(np.eye(3))]
_POSE = [
    *_POINT,
    HoldPose([0.1, 0, 0], [0, 0, 0.5]),
    ScrewInterpolation([0.1, 0, 0.2], [0, 0, 0.5], 1.0),
    ComposedPose(Circle(0.1, 2), _TURN[0]),
]
OTHERS: dict[type[Part], dict[str, Any]] = {
    AngularMomentum: {**_TASK, "trajectory": _POINT, "rate": 5},
    CenterOfMass: {**_TRACKING, "trajectory": _POINT, "axes": ["xy", "zx"]},
    FrameOrientation: {**_TRACKING, **_SPRING, **_FRAME, "trajectory": _TURN},
    FramePose: {**_TRACKING, **_SPRING, **_FRAME, "trajectory": _POSE,
     "along": "tool"},
    FramePosition: {**_TRACKING, **_SPRING, **_FRAME, "trajectory": _POINT,
     "axes": "y"},
    Gains: {"kp": [3, [1, 2], np.array([1.0, 3.0]), [[4, 0.1], [0.2, 5]]],
     "kv": [np.float32(2.5), [1.0, 2.0]]},
    Impedance: {"stiffness": [3, [0, 2], np.array([1.0, 3.0]), [[4, 0.1], [0.1, 5]]],
     "damping": [2, [1, 2], [[4, 0.1], [0.1, 5]]], "damping_ratio": 0.7,
     "largest_force": [40, "none", None, [40.0, None], np.array([40.0, 5.0])]},
    JointPosture: {**_TASK, **_GAINS, **_SPRING,
     "reference": ["home", np.linspace(-1, 1, 7), [0, 1, 0]],
     "joints": [["panda_joint1"], ("panda_joint2", "panda_joint1")],
     "displacement": _POINT},
    Pointing: {**_TASK, **_GAINS, **_FRAME, "direction": np.array([1.0, 0, 0]),
     "axis": (0, 2, 0)},
    RelativePose: {**_TRACKING, **_FRAME, "trajectory": _POSE, "reference": "base"},
}  # fmt: skip
"""Per field another value, or a list of them."""
ALONE: dict[type[Part], list[Part]] = {
    Gains: [
        Gains(natural_frequency=3.0),
        Gains(natural_frequency=[3.0, 4], damping_ratio=0.7),
    ],
    Pointing: [Pointing(trajectory=each) for each in _TURN],
}
"""Fields that exclude those of the example."""


def others(part: Part) -> Iterator[Part]:
    """Yield copies of the part with one other value each."""
    for field, values in OTHERS[type(part)].items():
        for value in values if isinstance(values, list) else [values]:
            yield replace(part, **{field: value})  # type: ignore[type-var]
    yield from ALONE.get(type(part), [])


ALL = [each for part in EXAMPLES.values() for each in (part, *others(part))]


@pytest.mark.parametrize("part", ALL, ids=repr)
def test_tasks_and_gains_are_values(part: Part) -> None:
    assert_is_a_value(part, NAMES)


# --- bare values that stand for a trajectory -----------------------------------------

TURNED = Quaternion(np.array([0.6, 0.0, 0.0, 0.8]))
THERE = SE3(TURNED, np.array([0.4, 0.1, 0.5]))


@pytest.mark.parametrize(
    "value",
    [THERE, SE3ToXYZQUAT(THERE), THERE.homogeneous, SE3ToXYZQUAT(THERE).tolist()],
)
def test_a_pose_is_held(value: Any) -> None:
    for task in (FramePose("hand", value), FramePose(trajectory=value)):
        held = task.followed.sample(0.0)
        np.testing.assert_allclose(held.position.position, THERE.translation)
        np.testing.assert_allclose(held.orientation.rotation, THERE.rotation)


def test_a_point_and_an_orientation_are_held() -> None:
    assert FramePose("hand", (0.4, 0, 0.5)).trajectory == Hold([0.4, 0.0, 0.5])
    assert Obstacle("ball", Sphere(0.1), np.zeros(3)).center == Hold([0.0, 0.0, 0.0])
    for value in (TURNED, TURNED.coeffs(), TURNED.matrix(), [0.6, 0.0, 0.0, 0.8]):
        held = FrameOrientation("hand", value).trajectory.sample(0.0)
        np.testing.assert_allclose(held.rotation, TURNED.matrix())


# --- refusals -----------------------------------------------------------------------

Wrong = dict[str, list[tuple[Any, str]]]
_WRONG_TASK: Wrong = {
    "priority": [(0, "priority: 0 ... at least 1"),
     (1.5, "priority: 1.5 ... an int")],
    "schedule": [([(0, 1)], "schedule: ... a list ... a Schedule"),
     ({"intervals": [[0, 1]], "rmap": 1}, "schedule.rmap: unknown ... 'rmap'")],
    "name": [(3, "name: 3 "), ("a b", "task name 'a b'")],
}  # fmt: skip
_WRONG_GAINS: Wrong = {
    "gains": [(3.0, "gains: 3.0, a float; needs a Gains"),
     ({"kp": -1, "kv": 1}, "gains.kp: -1 ... greater than 0"),
     ({"Kp": 1}, "gains.Kp: unknown ... 'Kp' ... 'kp'")],
    "largest_error": [(0, "largest_error: 0 ... greater than 0"),
     ([0.1, -1], "largest_error.1: -1 ... greater than 0"),
     (np.inf, "largest_error: inf ... finite"),
     ("robt", "largest_error: 'robt' ... 'robot'")],
}  # fmt: skip
_WRONG_TRACKING: Wrong = {
    **_WRONG_TASK,
    **_WRONG_GAINS,
    "blend": [(0.0, "blend: 0.0 ... greater than 0")],
}
_WRONG_SPRING: Wrong = {
    "impedance": [
        (100.0, "impedance: 100.0 ... an Impedance"),
        ({"damping": 3}, "impedance: missing key 'stiffness'"),
        ({"stiffness": -1}, "impedance.stiffness: -1 ... at least 0"),
    ]
}
_WRONG_FRAME: Wrong = {"frame": [(7, "frame: 7 ... a str")]}
_WRONG_POINT: list[tuple[Any, str]] = [
    (SE3.Identity(), "trajectory: an SE3 ... .translation"),
    ({"type": "hodl"}, "trajectory.type: unknown ... 'hodl' ... 'hold'"),
    ({"type": "circle", "radius": 1}, "trajectory: missing key 'angular_rate'"),
    (HoldPose([0, 0, 0], np.eye(3)), "trajectory: a HoldPose"),
]
_WRONG_TURN: list[tuple[Any, str]] = [
    (Hold([0, 0, 0]), "trajectory: a Hold ... orientations"),
    ("hold", "'hold', a str ... hsp.trajectories.HoldOrientation"),
]
_WRONG_POSE: list[tuple[Any, str]] = [
    (HoldOrientation(), "trajectory: a HoldOrientation ... poses"),
    ({"type": "spin"}, "trajectory.type: unknown type 'spin'"),
]
_WRONG_AXES: list[tuple[Any, str]] = [
    ("xx", "axes: 'xx' ... distinct"),
    (["x"], "axes: ['x'] ... a str"),
]
WRONG: dict[type[Part], Wrong] = {
    AngularMomentum: {**_WRONG_TASK, "trajectory": _WRONG_POINT,
     "rate": [(-1, "rate: -1 ... negative"), (np.inf, "rate: inf ... finite")]},
    CenterOfMass: {**_WRONG_TRACKING, "trajectory": _WRONG_POINT, "axes": _WRONG_AXES},
    FrameOrientation: {**_WRONG_TRACKING, **_WRONG_SPRING, **_WRONG_FRAME,
     "trajectory": _WRONG_TURN},
    FramePose: {**_WRONG_TRACKING, **_WRONG_SPRING, **_WRONG_FRAME,
     "trajectory": _WRONG_POSE},
    FramePosition: {**_WRONG_TRACKING, **_WRONG_SPRING, **_WRONG_FRAME,
     "trajectory": _WRONG_POINT, "axes": _WRONG_AXES},
    Gains: {"kp": [(0, "kp: 0 ... greater than 0")],
     "kv": [([1.0, np.nan], "kv.1: nan ... finite")],
     "natural_frequency": [(1.0, "either kp and kv")],
     "damping_ratio": [(1.0, "either kp and kv ... damping_ratio")]},
    Impedance: {"stiffness": [(0, "stiffness is 0 in every direction"),
        ([1.0, np.nan], "stiffness.1: nan ... finite"),
        ([[1, 0, 0], [0, 1, 0]], "stiffness ... (2, 3)"),
        ([[1, 0.2], [0.1, 1]], "stiffness ... symmetric"),
        ([[1, 2], [2, 1]], "eigenvalue -1")],
     "damping": [(-3, "damping: -3 ... at least 0"),
        ([[2, 1], [0, 2]], "damping is ... symmetric"),
        ([[1, 2], [2, 1]], "damping is ... eigenvalue"),
        ([1, 0], "damping is [1.0, 0.0] ... damp")],
     "damping_ratio": [([1, 2], "damping_ratio: [1, 2] ... list")],
     "largest_force": [(0, "largest_force: 0 ... greater than 0"),
        ([40, -1], "largest_force.1: -1 ... greater than 0"),
        ("robt", "largest_force: 'robt' ... 'robot'")]},
    JointPosture: {**_WRONG_TASK, **_WRONG_SPRING, **_WRONG_GAINS, "reference": [
        ("hom", "reference: 'hom' ... 'start'"),
        ([], "reference"),
        ([0.0, np.nan], "reference.1: nan ... finite")],
     "joints": [("joint1", "joints: 'joint1'"), ([3], "joints.0: 3 is an int")],
     "displacement": [(Spin([0, 0, 1], 1), "displacement: a Spin")]},
    Pointing: {**_WRONG_TASK, **_WRONG_GAINS, **_WRONG_FRAME, "direction": [
        ([0, 0, 0], "direction must be non-zero"),
        ([1, 0], "direction: [1, 0] ... 2 ... 3"),
        (None, "direction and trajectory")],
     "axis": [([0, 0, 0], "axis must be non-zero"), ("x", "axis: 'x' is a str")],
     "trajectory": [(HoldOrientation(), "direction and trajectory")]},
    RelativePose: {**_WRONG_TRACKING, **_WRONG_FRAME, "trajectory": _WRONG_POSE,
     "reference": [(None, "reference: ... expected a str")]},
}  # fmt: skip
"""Wrong values per field, and their messages."""


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
    """By one error of the family, which names the field."""
    name = cls.__name__
    with pytest.raises(cls.error, match=wording(f"{name}: ... {message}")) as raised:
        replace(EXAMPLES[cls], **{field: value})  # type: ignore[type-var]
    assert field in str(raised.value)
    assert "\n" not in str(raised.value)


# --- no memory -----------------------------------------------------------------------


@pytest.mark.parametrize("cls", [cls for cls in MEMBERS if issubclass(cls, Task)])
def test_one_task_serves_many_states_of_many_robots_in_many_threads(cls: Any) -> None:
    """As one after the other, bit for bit; no state remains in it."""
    robots = [panda(), Robot.load("iiwa14")] if cls is not RelativePose else [panda()]
    example = EXAMPLES[cls]
    assert isinstance(example, Task)
    rng, fields = np.random.default_rng(3), {field.name for field in value_fields(cls)}
    work: list[tuple[Task, Robot, float, Any, Any]] = []
    for robot in robots:
        task = placed(example, robot)
        assert set(vars(task)) == fields
        for _ in range(6):
            q, v = robot.random_configuration(rng), rng.standard_normal(robot.nv)
            work.append((task, robot, rng.uniform(0.0, 1.0), q, v))
    barrier = Barrier(len(work))

    def evaluate(k: int, wait: bool) -> list[Any]:
        task, robot, t, q, v = work[k]
        state = robot.state(t, q, v)
        if wait:
            barrier.wait()
        return [array.copy() for _ in range(3) for array in task.evaluate(state)]

    one_by_one = [evaluate(k, wait=False) for k in range(len(work))]
    with ThreadPoolExecutor(len(work)) as pool:
        together = list(pool.map(lambda k: evaluate(k, wait=True), range(len(work))))
    for first, second in zip(one_by_one, together, strict=True):
        for a, b in zip(first, second, strict=True):
            np.testing.assert_array_equal(a, b)
    for task, *_ in work:  # functions of the fields alone
        assert set(vars(task)) - fields <= {"_desired", "_axis", "_normals"}
        assert pickle.loads(pickle.dumps(task)) == task


def test_a_changed_copy_of_a_part_computes_for_itself() -> None:
    """A task with replaced gains, at the same state."""
    robot = Robot.load("planar3r")
    q = robot.integrate(robot.home(), np.array([0.3, 0.2, 0.1]))
    state = robot.state(0.0, q, np.ones(3))
    gains, path = Gains(25.0, 10.0), Hold([1.0, 1.0])
    task = FramePosition("tip", path, gains=gains, axes="xy")
    first = task.evaluate(state)
    other = replace(task, gains=Gains(100.0, 10.0))
    theirs, mine = other.evaluate(state), task.evaluate(state)
    np.testing.assert_array_equal(mine.acceleration, first.acceleration)
    extra = 75.0 * mine.error
    np.testing.assert_allclose(theirs.acceleration, mine.acceleration + extra)
