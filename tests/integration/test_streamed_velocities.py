"""Streamed velocities of a hand, a direction, a relative pose and joints."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from places import covering, further

import hsp_control as hsp
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.tasks import RelativePose
from hsp_control.trajectories import ComposedPose

PANDA = hsp.Robot.load("panda")
TWIST = np.array([0.06, -0.04, 0.05, 0.2, -0.3, 0.25])


def until(last: float, send: Callable[[float], object]) -> Callable[[LogWriter], None]:
    """Return an ``on_row`` for rows of 10 ms that sends every 20 ms until a time
    [s]."""
    rows = iter(range(10**9))

    def on_row(_: LogWriter) -> None:
        k = next(rows)
        if k % 2 == 0 and 0.01 * k < last:
            send(0.01 * k)

    return on_row


def stick(t: float) -> np.ndarray:
    """Return a twist as from a joystick."""
    return TWIST * np.cos([2 * t, t, 3 * t, t, 2 * t, 1.5 * t])


@pytest.mark.parametrize(
    ("case", "axes"),
    covering(
        [
            (hsp.FramePose("panda_tcp"), slice(6)),
            (RelativePose("panda_tcp", reference="panda_link1"), slice(6)),
            (
                hsp.Pointing("panda_tcp", trajectory=hsp.StreamOrientation()),
                slice(3, 6),
            ),
            (hsp.FrameOrientation("panda_tcp"), slice(3, 6)),
        ],
        ["world", "tool"],
    ),
)
def test_tracking_and_the_null_space_are_as_exact_as_without_a_stick(
    case: tuple[Any, slice], axes: Any
) -> None:
    """The law in the integrator's stages, without sampling: only the integrator's
    error.

    RK4 is of third order in steps within which the jerk of the reference jumps.
    """
    task, rows = case
    kind = hsp.StreamPose if rows == slice(6) else hsp.StreamOrientation
    stream = kind(axes=axes)
    hand = replace(task, trajectory=stream, name="hand")
    controller = hsp.Controller(PANDA, [hand], hsp.JointCentering(), null_space_gain=8)
    led = controller.stream("hand")
    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=1.5,
        integrator=hsp.integrators.Rk4(1e-3),
        on_row=until(1.0, lambda t: led.send(velocity=stick(t)[rows])),
    )
    assert np.abs(run["task.hand.error"]).max() < 2e-6
    expected = run["null_space_norm"][0] * np.exp(-8.0 * run.t)
    assert np.abs(run["null_space_norm"] - expected).max() < 1e-5
    assert np.ptp(run["task.hand.reference"], axis=0).max() > 0.02  # it was moving
    assert not np.ptp(run["task.hand.reference"][-15:], axis=0).any()  # and is at rest


def test_a_relative_pose_is_led_along_the_axes_of_its_reference() -> None:
    """Link 1 is rotated by 0.6 rad."""
    stream = hsp.StreamPose()
    hand = RelativePose(
        "panda_tcp", reference="panda_link1", trajectory=stream, name="hand"
    )
    controller = hsp.Controller(PANDA, [hand], hsp.JointCentering())
    led = controller.stream("hand")
    q = PANDA.home() + np.array([0.6, 0, 0, 0, 0, 0, 0])
    run = hsp.simulate(
        controller,
        q,
        duration=1.0,
        control_period=1e-3,
        on_row=until(2.0, lambda t: led.send(velocity=[0.05, 0, 0, 0, 0, 0])),
    )
    moved = np.diff(run["task.hand.actual"][[50, 90]], axis=0)[0]
    assert moved[:3] == pytest.approx([0.4 * 0.05, 0.0, 0.0], abs=2e-5)
    assert np.abs(run["task.hand.error"]).max() < 1e-3


def test_joints_are_jogged() -> None:
    """Sampled at 1 kHz, a velocity of 0.3 rad/s lags by less than a tenth of a step."""
    stream = hsp.Stream(dead_man=0.1)
    task = hsp.JointPosture([0.0] * 7, displacement=stream)
    controller = hsp.Controller(PANDA, [task])
    jog = np.array([0.3, 0.0, 0.0, 0.2, 0.0, 0.0, -0.3])
    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=1.5,
        control_period=1e-3,
        on_row=until(1.0, lambda t: controller.stream("posture").send(velocity=jog)),
    )
    assert np.abs(run.v[90] - jog).max() < 1e-4
    assert np.abs(run.v[-1]).max() < 1e-3
    assert np.abs(run["task.posture.error"]).max() < 1e-4


@pytest.mark.parametrize("axes", ["tool", *further("world")])
def test_a_velocity_is_set_at_any_time(axes: Any) -> None:
    """A velocity stream replaces a circle smoothly, and releases the hand at rest."""
    circle = hsp.Circle(radius=0.03, angular_rate=2.0)
    pose = ComposedPose(circle)
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", pose, name="hand")])
    twist = np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.4])

    def lead(t: float) -> None:
        if t > 0.4:
            controller.set_velocity("hand", twist, axes)

    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=2.0,
        control_period=1e-3,
        log_period=1e-3,
        on_row=until(30.0, lead),
    )
    assert len(run.meta["changes"]) == 1
    frame = PANDA.state(2.0, run.q[-1], run.v[-1]).frame("panda_tcp")
    axes_of = frame.rotation if axes == "tool" else np.eye(3)
    linear, angular = axes_of.T @ frame.velocity[:3], axes_of.T @ frame.velocity[3:]
    assert linear == pytest.approx(twist[:3], abs=2e-4)
    assert angular == pytest.approx(twist[3:], abs=1e-3)
    assert np.abs(np.diff(run.tau, axis=0)).max() < 1.5  # [N·m], no jump


def test_a_stick_that_sends_no_more_leaves_the_hand_at_rest() -> None:
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", name="hand")])
    twist = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    lead = until(0.5, lambda t: controller.set_velocity("hand", twist))
    run = hsp.simulate(
        controller, PANDA.home(), duration=1.5, control_period=1e-3, on_row=lead
    )
    reference = run["task.hand.reference"]
    assert np.diff(reference[[45, 55], 0]) == pytest.approx(0.01, abs=1e-9)
    # 0.48 s, the dead-man time of 0.2 s, and at most 0.1 s of fading
    assert np.ptp(reference[80:], axis=0).max() == 0.0
    assert np.abs(run.v[-1]).max() < 1e-4


def test_a_direction_is_a_target_of_a_pointing_task() -> None:
    task = hsp.Pointing("panda_tcp", direction=[0, 0, -1], name="eye")
    controller = hsp.Controller(PANDA, [task], hsp.JointCentering())
    goal = np.array([0.5, 0.2, -1.0])
    sent = iter([True])
    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=2.0,
        control_period=1e-3,
        on_row=lambda _: next(sent, None) and controller.set_target("eye", goal),
    )
    wanted = goal / np.linalg.norm(goal)
    assert run["task.eye.actual"][-1] == pytest.approx(wanted, abs=1e-4)
    assert np.abs(run["task.eye.error"]).max() < 2e-4


def test_a_velocity_that_fits_no_task_is_refused() -> None:
    hand = hsp.FramePose("panda_tcp", name="hand")
    controller = hsp.Controller(PANDA, [hand])
    with pytest.raises(hsp.errors.ControllerError, match="there is no task 'hnd'"):
        controller.set_velocity("hnd", TWIST)
    with pytest.raises(hsp.errors.StreamError, match="velocity has 3 numbers; this"):
        controller.set_velocity("hand", TWIST[:3])


def test_a_stick_in_yaml_names_its_axes_and_its_dead_man(tmp_path: Any) -> None:
    messages = [
        {"at": 0.02 * k, "velocity": TWIST.tolist(), "axes": axes}
        for k, axes in enumerate(["tool"] * 20 + [None] * 10)
    ]
    stream = {"type": "stream", "axes": "world", "dead_man": 0.15, "messages": messages}
    data = {
        "robot": {"name": "panda"},
        "tasks": {"hand": {"type": "frame_pose", "trajectory": stream}},
        "simulation": {
            "duration": 1.0,
            "control_period": 1e-3,
            "integrator": {"type": "semi_implicit_euler", "step": 1e-3},
        },
    }
    run = hsp.load_experiment(data).run()
    assert run["stream.hand.taken"][-1] == 30
    assert run["stream.hand.rejected"].max() == 0
    assert not np.ptp(run["task.hand.reference"][90:], axis=0).any()
    again = hsp.load_experiment(run.save(tmp_path / "run.npz")).run()
    assert np.array_equal(run.q, again.q)
