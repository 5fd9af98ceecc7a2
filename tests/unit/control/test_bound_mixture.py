"""A step that mixes tasks or limits is one call, equal to its parts in sequence."""

from collections.abc import Callable

import numpy as np
import pytest
from places import covering

import hsp_control as hsp
from hsp_control.control.actuation import Actuation, Status
from hsp_control.control.changes import Changes

H, BEGIN, RAMP = 1e-3, 0.010, 0.020
ROBOT = hsp.Robot.load("panda")
POSTURE = hsp.JointPosture("start", joints=["panda_joint1"], name="posture", priority=2)
TURNED = hsp.FrameOrientation("panda_tcp", name="turned", priority=2)

CHANGES: dict[str, Callable[[Changes], object]] = {
    "add": lambda at: at.add(POSTURE),
    "remove": lambda at: at.remove("turned"),
    "exchange": lambda at: at.remove("turned").add(POSTURE),
    # both constrain the same motion
    "same": lambda at: at.remove("hand").add(hsp.FramePosition("panda_tcp")),
    "limits": lambda at: at.limits(hsp.Limits(bandwidth=30.0)),
    "no limits": lambda at: at.limits(None),
    "both": lambda at: at.remove("turned").limits(hsp.Limits(bandwidth=30.0)),
}


def controller(kind: str, speed: float | None = None) -> hsp.Controller:
    """Return a controller during a change, with an active speed limit."""
    tasks = [hsp.FramePosition("panda_tcp", name="hand"), TURNED]
    limits = hsp.Limits() if speed is None else hsp.Limits(velocity=np.full(7, speed))
    made = hsp.Controller(ROBOT, tasks, hsp.JointCentering(), limits=limits)
    made.applied(made.compute(0.0, ROBOT.home(), np.zeros(7)).tau, H)
    CHANGES[kind](made.at(BEGIN).ramp(RAMP))
    return made


def moves(k: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the time, q and v of the k-th step."""
    swing = 0.3 * np.sin(np.arange(7.0))
    return k * H, ROBOT.integrate(ROBOT.home(), k * H * swing), swing


@pytest.mark.parametrize("kind", CHANGES)
def test_no_part_is_delivered_by_python(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = controller(kind)

    def refused(*_: object) -> object:
        raise AssertionError("a part of the mixture is delivered by Python")

    monkeypatch.setattr(Actuation, "deliver", refused)
    for k in range(1, 45):
        made.applied(made.compute(*moves(k)).tau, H)


@pytest.mark.parametrize(("kind", "speed"), covering(CHANGES, [0.31, None]))
def test_it_delivers_the_result_of_its_parts(kind: str, speed: float | None) -> None:
    """Equal to the step part by part, which a modifier (here an idle one) requires."""
    whole, parts = controller(kind, speed), controller(kind, speed)
    statuses = set()
    for k in range(1, 45):
        out = whole.compute(*moves(k))
        apart = parts.compute(*moves(k), modifier=lambda _, __, a: (a, None))
        np.testing.assert_allclose(out.tau, apart.tau, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            out.acceleration, apart.acceleration, rtol=0, atol=1e-8
        )
        assert (out.status, out.damped) == (apart.status, apart.damped)
        statuses.add(out.status)
        for each in (whole, parts):
            each.applied(out.tau, H)
    assert speed is None or Status.LIMITED in statuses


@pytest.mark.parametrize("scheduled", [False, True])
def test_it_delivers_the_result_of_its_parts_on_feet(scheduled: bool) -> None:
    """A foot is lifted by a change or a schedule, while another one pushes less."""
    pytest.importorskip("example_robot_data")
    robot = hsp.Robot.load("solo12")
    feet = [name for name in robot.frame_names if name.endswith("_FOOT")]
    lifted = hsp.trajectories.Schedule([(None, BEGIN + RAMP)], ramp=RAMP)
    push = hsp.contacts.CommandedForce(3.0)

    def standing() -> hsp.Controller:
        first = hsp.contacts.PointContact(
            feet[0], schedule=lifted if scheduled else None
        )
        pushing = hsp.contacts.PointContact(feet[1], force=push)
        others = [hsp.contacts.PointContact(foot) for foot in feet[2:]]
        trunk = hsp.FramePose("base_link", name="trunk")
        made = hsp.Controller(robot, [trunk], contacts=[first, pushing, *others])
        q, v = robot.home(), np.zeros(robot.nv)
        made.applied(made.compute(0.0, q, v).tau, H)
        if not scheduled:
            made.at(BEGIN).ramp(RAMP).contact(feet[0], active=False)
        made.at(BEGIN).ramp(RAMP).force(feet[1], hsp.contacts.CommandedForce(2.0))
        return made

    whole, parts = standing(), standing()
    q, v = robot.home(), 0.01 * np.ones(robot.nv)
    points = set()
    for k in range(1, 45):
        out = whole.compute(k * H, q, v)
        apart = parts.compute(k * H, q, v, modifier=lambda _, __, a: (a, None))
        np.testing.assert_allclose(out.tau, apart.tau, rtol=0, atol=1e-9)
        np.testing.assert_allclose(out.forces, apart.forces, rtol=0, atol=1e-8)
        assert (out.status, out.damped) == (apart.status, apart.damped)
        points.add(len(out.forces))
        for each in (whole, parts):
            each.applied(out.tau, H)
    assert points == {9, 12}
