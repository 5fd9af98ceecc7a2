"""Changes at run time: one time line, smooth also where changes overlap."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from drawn_changes import SPAN, Line
from hypothesis import given, settings
from hypothesis import strategies as st
from places import THOROUGH

import hsp_control as hsp
from hsp_control.common.arrays import Array

ROBOTS = ["planar3r", "iiwa14", "panda"]


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
    """Efforts change no more where a change begins or ends than elsewhere."""
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
    "duplicate",
    [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))],
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


# -- single changes -----------------------------------------------------------------


@pytest.fixture
def panda() -> "Trial":
    return Trial()


class Trial:
    """The Panda at home, with its target 3 cm away."""

    def __init__(self, **options: Any) -> None:
        self.robot = hsp.Robot.load("panda")
        self.q, self.v = self.robot.home(), np.zeros(7)
        point = self.robot.state(0.0, self.q, self.v).position("panda_tcp")
        hand = hsp.FramePosition("panda_tcp", hsp.Hold(point + 0.02), name="hand")
        self.controller = hsp.Controller(
            self.robot, [hand], **({"limits": None} | options)
        )

    def first_effort(self) -> Array:
        """Return the effort of the first step [N·m]."""
        return self.controller.compute(0.0, self.q, self.v).tau


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
    """Invalid changes are refused at the call and leave no trace."""
    with pytest.raises(hsp.HspControlError, match=message):
        make(panda.controller)
    assert panda.controller.changes == ()
    # A step of the same controller without one
    np.testing.assert_array_equal(panda.first_effort(), Trial().first_effort())


@pytest.mark.parametrize("ramp", [0.3, 0.01])
def test_efforts_have_no_jump_where_a_ramp_ends(ramp: float) -> None:
    """s rounds to 1 at 2e-6 of the ramp before its end, where s'' is not zero yet."""
    robot = hsp.Robot.load("panda")
    q, v, end = robot.home(), np.zeros(7), 0.1 + ramp
    here = robot.state(0.0, q, v).position("panda_tcp")
    made = hsp.Controller(
        robot,
        [hsp.FramePosition("panda_tcp", hsp.Hold(here), name="hand")],
        hsp.JointCentering(),
        limits=None,
    )
    changes = made.at(0.1).ramp(ramp).reference("hand", hsp.Hold(here + 0.05))
    changes.tool("panda_tcp", [0.0, 0.0, 0.1]).payload("panda_hand", 2.0)
    made.compute(0.0, q, v)
    left = np.array([1e-5, *np.linspace(1e-7, 2e-6, 20), 0.0])  # of the ramp
    *taus, there = (copy.copy(made).compute(end - x * ramp, q, v).tau for x in left)
    slope = (taus[0] - there) / left[0]
    assert np.abs(slope).max() > 100.0
    for x, tau in zip(left[1:], taus[1:], strict=False):  # s'' is linear in it
        np.testing.assert_allclose(tau - there, slope * x, rtol=1e-3, atol=1e-9)
