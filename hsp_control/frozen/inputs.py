"""The inputs of a frozen controller while it runs: gains, K_N, and targets.

Gains are as on a controller's time line: they crossfade to a new value, from
the present one; see `Evolution`, and ``engine/frozen/evolve.hpp``. An impedance
does so, too, and waits where it would add energy; see `FollowedImpedance`.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FreezeError
from hsp_control.constraints.contacts.contact import (
    NORMAL,
    WRENCH,
    Contact,
    shares,
)
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.change_model import MOST_GRAVITY
from hsp_control.control.controller import Controller
from hsp_control.control.followed_impedance import FollowedImpedance
from hsp_control.declaration import within
from hsp_control.declaration.language import spoken
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import LARGEST
from hsp_control.engine import Call
from hsp_control.frozen.image import (
    PAYLOAD,
    RATE,
    SPRING,
    TARGET,
    TIME,
    VELOCITY,
    Port,
)
from hsp_control.frozen.task_sets import Reported, TaskSets
from hsp_control.law import VARYING
from hsp_control.null_space.fields.weight import SetWeight
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.impedance import Impedance
from hsp_control.trajectories.hold import SetPoint
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.planner import Planner

_MOST = 8
"""How many ramps of one input may be under way."""
_SIDES = (1, 0), (-1, 0), (0, 1), (0, -1)
"""Of a friction pyramid, along its tangents."""


class Input(NamedTuple):
    """An input, the calls that bring it up to a time, and those after a step."""

    port: Port
    calls: tuple[Call, ...]
    after: tuple[Call, ...] = ()


def inputs_of(
    own: Controller, bound: BoundStep, held: Array, reports: Reported
) -> Iterator[Input]:
    """Yield the inputs of a controller.

    Args:
        own: The controller.
        bound: Its step.
        held: How long its efforts are held, shape (1,) [s].
        reports: Its reports of tasks.
    """
    period = float(held[0])
    for task in own.tasks:
        impedance = impedance_of(task)
        if impedance is not None:
            yield from _springs(task, impedance, bound, held, reports)
            continue
        # A scalar error is unstable from these on, for any value of the other.
        Kp, Kv, *_ = own.feedback(task.name)
        if task.order == 1:
            meaning, most = "rate of the error", 2.0 / period
            yield _matrix(f"{task.name}.K", "1/s", meaning, Kp, most)
            continue
        meaning, most = "stiffness of the error equation", 4.0 / period**2
        yield _matrix(f"{task.name}.Kp", "1/s²", meaning, Kp, most)
        meaning, most = "damping of the error equation", 2.0 / period
        yield _matrix(f"{task.name}.Kv", "1/s", meaning, Kv, most)
    yield from _weights(own)
    yield from _forces(own)
    K_N = bound.active.law.problem.gain
    meaning = "K_N, rate of the null-space error"
    name, most = "null_space_gain", min(2.0 / period, LARGEST)
    if own.metric.form != VARYING:
        yield _matrix(name, "1/s", meaning, K_N, most)
        return
    k = np.array([K_N[0, 0]])  # it is a multiple of the identity: see `checked_gain`
    evolve = _evolving(k, np.nextafter(0.0, 1.0), most, 0)
    port = Port(name, "1/s", meaning, k, evolve)
    yield Input(port, (evolve, engine.ScaledIdentity(k=k, out=K_N)))


def _springs(
    task: Task, impedance: Impedance, bound: BoundStep, held: Array, reports: Reported
) -> Iterator[Input]:
    """Yield the stiffness of a task, and its damping as it was declared."""
    in_force = next(x.in_force for x in bound.active.stacked if x.name == task.name)
    followed, numbers = FollowedImpedance(in_force, task.part_ends()), in_force.numbers
    flat, error = numbers.reshape(-1), reports.errors[task.name]
    now = _evolution(flat, 0.0, LARGEST)
    planned = followed.planned.reshape(-1), followed.ramp
    evolve = engine.EvolveImpedance(
        planned=now | {"x": planned[0], "ramp": planned[1]},
        G=in_force.mobility,
        period=held,
        waits=followed.waits,
        numbers=numbers,
    )
    then = now | {"x": followed.then.reshape(-1), "ramp": np.zeros(1)}
    errors = {"e": error.error, "e_dot": error.error_rate, "period": held}
    after = (
        engine.EvolveAhead(planned=then, period=held),
        engine.FollowImpedance(**followed.call.values | errors),
    )
    square = task.rows**2
    parts = [("stiffness", "N/m or N·m/rad", "stiffness, which waits for its energy")]
    if impedance.damping is None:
        parts.append(("damping_ratio", "-", "damping ratio of each mode"))
    else:
        parts.append(("damping", "N·s/m or N·m·s/rad", "damping"))
    places = {
        "stiffness": slice(square),
        "damping": slice(square, 2 * square),
        "damping_ratio": slice(2 * square, 2 * square + 1),
    }
    for name, unit, meaning in parts:
        array = flat[places[name]]
        port = Port(f"{task.name}.{name}", unit, meaning, array, evolve, SPRING)
        first = name == "stiffness"  # whose calls are those of all
        yield Input(port, (evolve,) if first else (), after if first else ())


def _weights(own: Controller) -> Iterator[Input]:
    """Yield the weights of fields that are numbers, and the presence of others.

    Of one name it is that of the last.
    """
    terms = {each.field.name: each.field.weight for each in own.setup.terms}
    for name, weight in terms.items():
        if not isinstance(weight, SetWeight):
            continue
        w, rate = weight.numbers[:1], weight.numbers[1:]
        if weight.ramp is None:
            at, meaning, most = f"{name}.weight", "weight of the field", LARGEST
        else:
            at, meaning, most = f"{name}.presence", "factor of the field's weight", 1.0
        evolve = _evolving(w, 0.0, most, 0, rate)
        yield Input(Port(at, "-", meaning, w, evolve), (evolve,))


def presences_of(sets: TaskSets) -> Iterator[Input]:
    """Yield the presences of the tasks that fade."""
    for k, name in enumerate(sets.names):
        x, meaning = sets.presences[k : k + 1], "how far the task is present, in [0, 1]"
        evolve = _evolving(x, 0.0, 1.0, 0)
        yield Input(Port(f"{name}.presence", "-", meaning, x, evolve), (evolve,))


def _forces(own: Controller) -> Iterator[Input]:
    """Yield the commanded forces that are numbers: normal ones, or with tangents."""
    for each in own.setup.contacts:
        force = each.contact.force
        if force is None or not isinstance(force.followed, SetPoint):
            continue
        x = force.followed.numbers
        if force.dimension == NORMAL:
            values, meaning = _evolution(x, 0.0, LARGEST), "normal force, which presses"
        else:  # within the friction pyramids at the points
            meaning = "two tangents and the normal"
            if force.dimension == WRENCH:
                meaning += ", and the moments about them"
            cone = {"cone": _pyramids(each.contact, own)}
            values = _evolution(x, -LARGEST, LARGEST) | cone
        evolve = engine.Evolve(**values)
        unit = "N, N·m" if force.dimension == WRENCH else "N"
        port = Port(f"{each.contact.name}.force", unit, meaning, x, evolve)
        yield Input(port, (evolve,))


def _pyramids(contact: Contact, own: Controller) -> Array:
    """Return rows with a·x ≥ 0 for the commands that push and do not slip anywhere."""
    assert contact.force is not None
    frame = own.setup.start.state.frame(contact.frame)
    S = shares(contact.force.dimension, contact.arms_in_axes(frame))
    one = [[0, 0, 1], *([i, j, contact.side] for i, j in _SIDES)]
    return np.vstack([np.array(one) @ S[k : k + 3] for k in range(0, len(S), 3)])


def model_inputs(
    own: Controller, bound: BoundStep, carrying: Sequence[str] | None
) -> Iterator[Input]:
    """Yield gravity, and the payloads of frames.

    Args:
        own: The controller.
        bound: Its step.
        carrying: The frames; None: those of the tasks that are not fixed to the world.

    Raises:
        FreezeError: If one of the frames is fixed to the world.
    """
    dynamics, gravity = bound.state.dynamics, np.array(own.robot.model.gravity.linear)
    own_gravity, change = gravity.copy(), np.zeros(3)
    evolve = _evolving(gravity, -MOST_GRAVITY, MOST_GRAVITY, 0)
    calls = (
        evolve,
        engine.Copy(x=gravity, out=change),
        engine.Subtract(x=own_gravity, out=change),
        engine.ChangeGravity(dynamics=dynamics, change=change),
    )
    port = Port("gravity", "m/s²", "gravity in the world", gravity, evolve)
    yield Input(port, calls)
    places, robot = {}, own.robot
    of_tasks = (getattr(task, "frame", None) for task in own.tasks)
    named = [each for each in of_tasks if isinstance(each, str)]
    for name in named if carrying is None else carrying:
        with within(spoken("--payload", "payloads")):
            frame = robot.model.frames[robot.frame_id(name)]
            if frame.parentJoint > 0:
                places[name] = frame
            elif carrying is not None:
                raise FreezeError(f"{name!r} is fixed to the world")
    if not places:
        return
    asked, frames = np.zeros((len(places), 10)), [*places.values()]
    payloads = engine.Payloads(
        dynamics=dynamics,
        joints=np.array([each.parentJoint for each in frames], dtype=np.int64),
        rotations=np.array([each.placement.rotation for each in frames]),
        positions=np.array([each.placement.translation for each in frames]),
        asked=asked,
        count=np.zeros(1, dtype=np.int64),
        frames=np.zeros(_MOST, dtype=np.int64),
        masses=np.zeros(_MOST),
        centers=np.zeros((_MOST, 3)),
        inertias=np.zeros((_MOST, 9)),
        changes=np.zeros(_MOST, dtype=np.int64),
        starts=np.zeros((_MOST, _MOST)),
        ramps=np.zeros((_MOST, _MOST)),
    )
    unit, meaning = "kg, m, kg·m²", "mass, centre, inertia (xx xy xz yy yz zz)"
    for k, name in enumerate(places):
        port = Port(f"{name}.payload", unit, meaning, asked[k], payloads, PAYLOAD)
        yield Input(port, (payloads,) if k == 0 else ())


def streams_of(own: Controller) -> dict[str, Planner]:
    """Return the streams of a controller without Python, by the tasks' names."""
    found = {}
    for task in own.tasks:
        for each in parts_within(task, FollowedStream):
            if each.run.alone is not None:
                found[task.name] = each.run.alone
    return found


def targets_of(own: Controller, streams: Mapping[str, Planner]) -> Iterator[Port]:
    """Yield the targets and velocities that a program sends.

    They are sent when the next step is made; a target may have a velocity, and a time
    by the program's clock.
    """
    for task in own.tasks:
        if task.name not in streams:
            continue
        stream = streams[task.name]
        sent, turns = stream.sent, stream.chart.rotational
        axes = "the body's" if stream.policy.axes == "tool" else "world"
        unit = "m or the task's, and a quaternion x, y, z, w" if turns else "the task's"
        meaning = "where the reference goes"
        at = f"{task.name}.target"
        yield Port(at, unit, meaning, sent["target"], stream.call, TARGET)
        meaning = f"how it moves until it fades: linear, then angular, in {axes} axes"
        at = f"{task.name}.velocity"
        yield Port(at, "1/s", meaning, sent["velocity"], stream.call, VELOCITY)
        meaning = "how the next target moves: linear, then angular, in world axes"
        at = f"{task.name}.target_velocity"
        yield Port(at, "1/s", meaning, sent["rate"], stream.call, RATE)
        meaning = "when the next target is, by any clock of the sender"
        at = f"{task.name}.target_time"
        yield Port(at, "s", meaning, sent["time"], stream.call, TIME)


def _matrix(name: str, unit: str, meaning: str, own: Array, most: float) -> Input:
    """Return a positive definite matrix as an input, row by row."""
    x = own.reshape(-1)
    assert np.shares_memory(x, own)
    evolve = _evolving(x, -most, most, len(own))
    return Input(Port(name, unit, meaning, x, evolve), (evolve,))


def _evolving(
    x: Array, least: float, most: float, definite: int, rate: Array | None = None
) -> Call:
    values = _evolution(x, least, most, definite)
    return engine.Evolve(**values if rate is None else values | {"rate": rate})


def _evolution(
    x: Array, least: float, most: float, definite: int = 0
) -> dict[str, Any]:
    """Return the arguments of an Evolve that begins at the present x."""
    return {
        "initial": x.copy(),
        "targets": np.zeros((_MOST, len(x))),
        "times": np.zeros((_MOST, 2)),
        "count": np.zeros(1, dtype=np.int64),
        "least": least,
        "most": most,
        "cone": np.zeros((0, len(x))),
        "definite": definite,
        "x": x,
        "rate": np.zeros(len(x)),
        "ramp": np.zeros(1),
    }
