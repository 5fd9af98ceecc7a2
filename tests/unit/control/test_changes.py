"""Changes while running: one time line, smooth however they overlap."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import THOROUGH

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.changes import Change

ROBOTS = ["planar3r", "iiwa14", "panda"]
SPAN = 3.0
"""The changes begin within this time [s]."""


class Line:
    """A controller whose changes are drawn at random, along a motion that is given."""

    def __init__(self, name: str, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.robot = hsp.Robot.load(name)
        away = 0.2 * np.ones(self.robot.nv)
        self.center = self.robot.integrate(self.robot.home(), away)
        self.swing = 0.1 * self.rng.standard_normal(self.robot.nv)
        self.frame = self.robot.end_effector
        self.there = ["hand"]
        self.terms = ["joint_centering"]
        self.made = 0

    def controller(self, changes: tuple[Change, ...] = ()) -> hsp.Controller:
        axes = "xz" if self.robot.nv == 3 else "xyz"
        hand = hsp.FramePosition(self.frame, axes=axes, name="hand")
        field = hsp.TargetPosture("home", name="joint_centering")
        start = self.center
        return hsp.Controller(
            self.robot, [hand], field, start=start, changes=changes, limits=None
        )

    def motion(self, t: float) -> tuple[Array, Array]:
        q = self.robot.integrate(self.center, self.swing * np.sin(3.0 * t))
        return q, 3.0 * self.swing * np.cos(3.0 * t)

    def state(self, t: float) -> hsp.RobotState:
        return self.robot.state(t, *self.motion(t))

    def efforts(self, controller: hsp.Controller, times: Array) -> Array:
        return np.array([controller.compute(self.state(t)).tau for t in times])

    def draw(self, number: int) -> tuple[Change, ...]:
        """Return changes in order of time, so that each is possible."""
        times = np.sort(self.rng.uniform(0.0, SPAN, number))
        return tuple(self._change(float(t)) for t in times)

    def _change(self, t: float) -> Change:
        rng, when = self.rng, {"at": t, "ramp": float(self.rng.uniform(0.1, 0.5))}
        kinds = ["gains", "weight", "field", "exchange", "gain", "add"]
        if len(self.there) > 1:
            kinds += ["remove", "remove"]
        match rng.choice(kinds):
            case "gains":
                gains = hsp.Gains(natural_frequency=float(rng.uniform(2.0, 15.0)))
                name = str(rng.choice(self.there))
                return hsp.changes.ChangeGains(name, gains, **when)
            case "weight":
                name = str(rng.choice(self.terms))
                weight = float(rng.uniform(0.0, 3.0))
                return hsp.changes.ChangeWeight(name, weight, **when)
            case "field":
                self.made += 1
                self.terms = [f"first_{self.made}", f"second_{self.made}"]
                posture = 0.3 * rng.standard_normal(self.robot.nv)
                fields = [
                    hsp.TargetPosture(posture, name=self.terms[0]),
                    hsp.TargetPosture("home", name=self.terms[1], weight=0.5),
                ]
                return hsp.changes.ChangeField(fields, **when)
            case "exchange":
                name = str(rng.choice(self.terms))
                nv = self.robot.nv
                sway = hsp.trajectories.Lissajous(
                    0.1 * rng.standard_normal(nv), np.ones(nv), None, np.zeros(nv)
                )
                other = hsp.TargetPosture("home", name=name, displacement=sway)
                return hsp.changes.ExchangeField(name, other, **when)
            case "gain":
                gain = float(rng.uniform(2.0, 20.0))
                return hsp.changes.ChangeNullSpaceGain(gain, **when)
            case "remove":
                name = str(rng.choice(self.there[1:]))
                self.there.remove(name)
                return hsp.changes.RemoveTask(name, **when)
            case _:
                joint = str(rng.choice(list(self.robot.joints)))
                self.made += 1
                # Now and then a name is used again.
                name = f"joint_{self.made % 3}"
                if name in self.there:
                    return self._change(t)
                self.there.append(name)
                task = hsp.JointPosture(
                    "home", joints=[joint], priority=2 + self.made % 2, name=name
                )
                return hsp.changes.AddTask(task, **when)


quick = settings(
    max_examples=5 if THOROUGH else 1, deadline=None, derandomize=not THOROUGH
)
seeds = st.integers(0, 2**32 - 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@given(seeds)
@quick
def test_efforts_stay_continuous_through_a_hundred_changes(
    name: str, seed: int
) -> None:
    """Where a change begins or ends, efforts change no more than anywhere else."""
    line = Line(name, seed)
    changes = line.draw(100)
    edges = np.array([[each.at, each.end] for each in changes]).ravel()
    between = line.rng.uniform(0.0, SPAN, 60)
    gap, millisecond = 1e-5, 1e-3
    halves = [*((t, gap) for t in edges), *((t, millisecond) for t in between)]
    halves.sort()
    times = np.array([(t, t + width) for t, width in halves])
    tau = line.efforts(line.controller(changes), times.ravel()).reshape(
        len(times), 2, -1
    )
    steps = np.abs(tau[:, 1] - tau[:, 0]).max(axis=1)
    widths = np.diff(times, axis=1)[:, 0]
    smooth = steps[widths > 0.5 * millisecond].max()
    assert steps[widths < 0.5 * millisecond].max() < 0.1 * smooth


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@given(seeds)
@quick
def test_in_the_end_it_is_as_if_built_that_way(name: str, seed: int) -> None:
    line = Line(name, seed)
    changed = line.controller(line.draw(100))
    line.efforts(changed, np.array([0.0, 1.0, SPAN + 1.0, SPAN + 3.0]))
    tasks = []
    for task in changed.tasks:
        Kp, Kv, *_ = changed.feedback(task.name)
        tasks.append(replace(task, gains=hsp.Gains(Kp, Kv)))  # type: ignore[call-arg]
    built = hsp.Controller(
        line.robot,
        tasks,
        changed.field,
        null_space_gain=changed.null_space_gain,
        limits=None,
    )
    assert sorted(task.name for task in tasks) == sorted(line.there)
    times = np.linspace(SPAN + 3.0, SPAN + 4.0, 7)
    np.testing.assert_array_equal(
        line.efforts(changed, times), line.efforts(built, times)
    )


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)
@given(seeds)
@quick
def test_copies_made_at_any_time_compute_the_same(duplicate: Any, seed: int) -> None:
    line = Line("panda", seed)
    controller = line.controller(line.draw(20))
    controller.restart(origin=0.0)
    for t in line.rng.uniform(0.0, SPAN, 3).cumsum():
        controller.compute(t, *line.motion(t))
        twin = duplicate(controller)
        for later in (t, t + 0.01, t + 0.3):
            np.testing.assert_array_equal(
                controller.compute(later, *line.motion(later)).tau,
                twin.compute(later, *line.motion(later)).tau,
            )


# -- the cases of the trial ---------------------------------------------------------


@pytest.fixture
def panda() -> "Trial":
    return Trial()


class Trial:
    """The Panda at home, with a hand that has to go 3 cm."""

    def __init__(self, **options: Any) -> None:
        self.robot = hsp.Robot.load("panda")
        self.q, self.v = self.robot.home(), np.zeros(7)
        point = self.robot.state(0.0, self.q, self.v).position("panda_tcp")
        hand = hsp.FramePosition("panda_tcp", hsp.Hold(point + 0.02), name="hand")
        self.controller = hsp.Controller(
            self.robot, [hand], **({"limits": None} | options)
        )

    def largest_step(self, act: Callable[[int], object], duration: float) -> float:
        """Return the largest step of effort in a millisecond [N·m]."""
        tau = []
        for k in range(round(duration * 1000)):
            act(k)
            tau.append(self.controller.compute(k * 1e-3, self.q, self.v).tau)
        return float(np.abs(np.diff(tau, axis=0)).max())


def gains(frequency: float) -> hsp.Gains:
    return hsp.Gains(natural_frequency=frequency)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda c: c.at(1).remove("hnad"), r"no task 'hnad'; did you mean 'hand'\?"),
        (lambda c: c.at(1).add(c.tasks[0]), "two tasks are called 'hand'"),
        (lambda c: c.at(1).gains("hand", hsp.Gains([1, 2], 1)), "kp has shape"),
        (lambda c: c.at(1).weight("rets", 2), r"no field 'rets'; did you mean 'rest'"),
        (lambda c: c.at(1).weight("rest", -2), r"weight: -2 is negative"),
        (lambda c: c.at(1).exchange("rets", hsp.Rest()), "no field 'rets'; did you"),
        (
            lambda c: c.at(1).exchange("rest", hsp.fields.Uncontrolled()),
            "cannot replace a field",
        ),
        (
            lambda c: c.at(1).exchange(
                "rest", hsp.TargetPosture(displacement=hsp.Hold([1.0, 2.0]))
            ),
            r"by\.displacement: point has 2 coordinates",
        ),
        (lambda c: c.at(1).ramp(-1).remove("hand"), "ramp: -1 is negative"),
        (lambda c: c.at(1).contact("foot", active=True), "no contact 'foot'"),
        (lambda c: c.at(1).null_space_gain(-1), "gain: "),
        (lambda c: c.at(np.inf).field(hsp.Rest()), "ChangeField: at: inf is not a f"),
        (lambda c: c.at(1).field(hsp.TargetPosture([0.0, 1.0])), "^fields.0.target: "),
        (
            lambda c: c.at(1).field(hsp.fields.Uncontrolled()),
            "uncontrolled null space cannot be blended",
        ),
    ],
)
def test_impossible_changes(
    make: Callable[[hsp.Controller], object], message: str, panda: Trial
) -> None:
    """Each is refused when it is made, and nothing of it stays."""
    with pytest.raises(hsp.HspControlError, match=message):
        make(panda.controller)
    assert panda.controller.changes == ()
    panda.largest_step(lambda k: None, 0.01)
