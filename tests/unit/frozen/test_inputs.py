"""Inputs of a frozen controller change as on a controller's time line."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from frozen_library import (
    LIB,
    OK,
    TOO_MANY,
    WRONG_NAME,
    WRONG_SIZE,
    WRONG_VALUE,
    Opened,
)

import hsp_control as hsp
from hsp_control.common.errors import FreezeError

H = 0.001


def pair(
    name: str, folder: Path, payloads: Sequence[str] | None = None
) -> tuple[hsp.Controller, Opened]:
    """Return a controller at the beginning of a run, and the same without Python."""
    controller = hsp.load_experiment(name).controller
    frozen = hsp.freeze(controller, folder / "frozen.hsp", payloads=payloads)
    return controller.preview(), Opened(frozen)


def run(
    controller: hsp.Controller,
    opened: Opened,
    steps: range,
    changes: dict[int, Callable[[float], object]],
) -> None:
    """Step both and compare; changes are made after a step, at its time."""
    q = controller._declared.start
    assert q is not None
    for k in steps:
        t, v = k * H, 0.1 * np.ones(controller.robot.nv)
        moved = q + 0.02 * np.sin(0.1 * k)
        output = controller.compute(t, moved, v)
        controller.applied(output.tau, H)
        assert opened.step(t, moved, v) == output.status
        np.testing.assert_array_equal(opened.tau, output.tau)
        if k in changes:
            changes[k](t)


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_gains_and_the_null_space_gain(ramp: float, tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    new = hsp.Gains(natural_frequency=14.0)
    Kp, Kv = 14.0**2 * np.eye(3), 28.0 * np.eye(3)

    def gains(t: float) -> None:
        controller.at(t).ramp(ramp).gains("hand", new)
        assert opened.ramp("hand.Kp", Kp, ramp) == OK
        assert opened.ramp("hand.Kv", Kv, ramp) == OK

    def null_space(value: float) -> Callable[[float], object]:
        def change(t: float) -> None:
            controller.at(t).ramp(ramp).null_space_gain(value)
            assert opened.ramp("null_space_gain", value * np.eye(7), ramp) == OK

        return change

    # one begins while another is under way
    changes = {5: gains, 10: null_space(4.0), 17: null_space(20.0)}
    run(controller, opened, range(60), changes)
    np.testing.assert_array_equal(opened.get("hand.Kp", 9), Kp.ravel())
    np.testing.assert_array_equal(
        opened.get("null_space_gain", 49).reshape(7, 7)[0, 0], 20
    )


@pytest.mark.parametrize("ramp", [0.0, 0.02])
@pytest.mark.parametrize("fields", [1, 2])
def test_weights_of_fields(fields: int, ramp: float, tmp_path: Path) -> None:
    """Also during an earlier change, to zero, and for a single field."""
    robot = hsp.Robot.load("panda")
    reach = hsp.Manipulability("panda_tcp")
    field = hsp.JointCentering() + 0.3 * reach if fields == 2 else hsp.JointCentering()
    hand = hsp.FramePosition(
        "panda_tcp", hsp.Circle(radius=0.1, angular_rate=2.0), name="hand"
    )
    declared = hsp.Controller(robot, [hand], field, start=robot.home())
    opened = Opened(hsp.freeze(declared, tmp_path / "frozen.hsp"))
    controller = declared.preview()

    def weight(name: str, value: float) -> Callable[[float], object]:
        def change(t: float) -> None:
            controller.at(t).ramp(ramp).weight(name, value)
            assert opened.ramp(f"{name}.weight", value, ramp) == OK

        return change

    last = field.name if fields == 1 else reach.name
    changes = {
        3: weight("joint_centering", 2.5),
        9: weight(last, 0.0),
        15: weight("joint_centering", 0.7),
        60: weight(last, 1.0),
    }
    run(controller, opened, range(90), changes)
    np.testing.assert_array_equal(opened.get(f"{last}.weight", 1), 1.0)
    run(controller, opened, range(90, 1300, 50), {})  # over, and forgotten


def test_over_the_mass_matrix_it_is_a_number(tmp_path: Path) -> None:
    controller, opened = pair("compliance/panda_joint_impedance", tmp_path)
    port = opened.ports["null_space_gain"]
    assert (port.size, port.is_input) == (1, 1)

    def change(t: float) -> None:
        controller.at(t).ramp(0.01).null_space_gain(3.0)
        assert opened.ramp("null_space_gain", 3.0, 0.01) == OK

    run(controller, opened, range(30), {4: change})
    assert "hand.Kp" not in opened.ports


def test_set_is_at_once_and_before_the_first_step_from_the_beginning(
    tmp_path: Path,
) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    assert opened.ramp("hand.Kp", 50.0 * np.eye(3), 1.0) == OK
    assert opened.set("null_space_gain", 3.0 * np.eye(7)) == OK
    controller.at(-1.0).ramp(0.0).null_space_gain(3.0)
    controller.at(-1.0).ramp(0.0).gains("hand", hsp.Gains(kp=50.0, kv=20.0))
    run(controller, opened, range(10), {})
    assert LIB.hsp_restart(opened.handle) == OK  # as in the file
    other = hsp.load_experiment("panda_limits").controller.preview()
    run(other, opened, range(10), {})


@pytest.mark.parametrize(
    ("name", "values", "duration", "status"),
    [
        ("hand.Kq", np.eye(3), 0.1, WRONG_NAME),
        ("hand.error", np.zeros(3), 0.1, WRONG_NAME),  # an output
        ("period", [0.002], 0.1, WRONG_NAME),
        ("hand.Kp", np.eye(2), 0.1, WRONG_SIZE),
        ("hand.Kp", np.nan * np.eye(3), 0.1, WRONG_VALUE),
        ("hand.Kp", -np.eye(3), 0.1, WRONG_VALUE),
        ("hand.Kp", np.ones((3, 3)) - np.eye(3), 0.1, WRONG_VALUE),
        ("hand.Kp", 1e9 * np.eye(3), 0.1, WRONG_VALUE),
        ("hand.Kv", 2001.0 * np.eye(3), 0.1, WRONG_VALUE),
        ("null_space_gain", np.zeros((7, 7)), 0.1, WRONG_VALUE),
        ("elbow.weight", [1.0], 0.1, WRONG_NAME),
        ("limit_barrier.weight", [1.0, 2.0], 0.1, WRONG_SIZE),
        ("limit_barrier.weight", [-1e-3], 0.1, WRONG_VALUE),
        ("limit_barrier.weight", [np.nan], 0.1, WRONG_VALUE),
        ("limit_barrier.weight", [1.0], -0.1, WRONG_VALUE),
        ("hand.Kp", np.eye(3), -0.1, WRONG_VALUE),
        ("hand.Kp", np.eye(3), np.nan, WRONG_VALUE),
        ("hand.Kp", np.eye(3), np.inf, WRONG_VALUE),
    ],
)
def test_a_wrong_request_changes_nothing(
    name: str, values: np.ndarray, duration: float, status: int, tmp_path: Path
) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    q = controller._declared.start
    run(controller, opened, range(3), {})
    assert opened.ramp(name, values, duration) == status
    assert opened.error
    assert q is not None
    run(controller, opened, range(3, 6), {})


def test_too_many_ramps_at_a_time(tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    run(controller, opened, range(1), {})
    for k in range(8):
        assert opened.ramp("hand.Kv", (20.0 + k) * np.eye(3), 0.01) == OK
    assert opened.ramp("hand.Kv", 30.0 * np.eye(3), 0.01) == TOO_MANY
    assert "8 ramps" in opened.error
    q = controller._declared.start
    assert q is not None
    for k in range(1, 12):
        assert opened.step(k * H, q, np.zeros(7)) >= OK
    np.testing.assert_array_equal(opened.get("hand.Kv", 9), 27.0 * np.eye(3).ravel())
    assert opened.ramp("hand.Kv", 30.0 * np.eye(3), 0.01) == OK


def reported(mass: float, center: list[float], moments: list[float]) -> np.ndarray:
    """Return a payload as a program sets it, of moments about the frame's axes."""
    a, b, c = moments
    return np.array([mass, *center, a, 0.0, 0.0, b, 0.0, c])


@pytest.mark.parametrize("name", ["panda_limits", "compliance/panda_joint_impedance"])
@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_payloads_are_taken_up_and_put_down(
    name: str, ramp: float, tmp_path: Path
) -> None:
    frame = "panda_link6"
    controller, opened = pair(name, tmp_path, [frame])

    def carry(
        mass: float, center: list[float], moments: list[float]
    ) -> Callable[[float], None]:
        def change(t: float) -> None:
            controller.at(t).ramp(ramp).payload(frame, mass, center, moments)
            body = reported(mass, center, moments)
            assert opened.ramp(f"{frame}.payload", body, ramp) == OK

        return change

    heavy = carry(2.0, [0.01, -0.02, 0.1], [0.01, 0.012, 0.009])
    light = carry(0.3, [0.0, 0.01, 0.05], [0.0, 0.0, 0.0])
    nothing = carry(0.0, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    # also during another change, the same one twice, and none after none
    changes = {
        3: heavy,
        8: light,
        12: light,
        20: nothing,
        22: heavy,
        60: nothing,
        90: nothing,
        93: light,
    }
    run(controller, opened, range(130), changes)


def test_an_observer_has_the_model_of_the_step(tmp_path: Path) -> None:
    """The model is evaluated before the law, in Python as without it."""
    experiment = hsp.load_experiment("panda_limits")
    observer = hsp.compensation.MomentumObserver(30.0)
    observed = hsp.compensation.Compensation(momentum_observer=observer)
    frozen = tmp_path / "observed.hsp"
    hsp.freeze(experiment.controller, frozen, compensation=observed, period=H)
    opened = Opened(frozen)
    controller = experiment.controller.preview()
    command = hsp.compensation.CompensatedController(controller, observed)
    command.restart(origin=0.0)
    place = next(at for at in opened.ports if at.endswith(".payload"))
    body = reported(1.0, [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    for k in range(60):
        t = k * H
        q = experiment.q0 + 0.02 * np.sin(0.1 * k)
        v = 0.1 * np.ones(7)
        tau = command.effort(t, q, v, H)
        opened.step(t, q, v)
        np.testing.assert_array_equal(opened.tau, tau)
        if k == 10:
            frame = place.split(".")[0]
            controller.at(t).ramp(0.02).payload(frame, 1.0, [0.0, 0.0, 0.1])
            assert opened.ramp(place, body, 0.02) == OK
        if k == 20:
            controller.at(t).ramp(0.02).gravity([1.0, 0.0, -9.0])
            assert opened.ramp("gravity", [1.0, 0.0, -9.0], 0.02) == OK


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_gravity(ramp: float, tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)

    def tilt(gravity: list[float]) -> Callable[[float], None]:
        def change(t: float) -> None:
            controller.at(t).ramp(ramp).gravity(gravity)
            assert opened.ramp("gravity", gravity, ramp) == OK

        return change

    changes = {4: tilt([1.0, 0.5, -9.6]), 15: tilt([0.0, 0.0, -1.62])}
    run(controller, opened, range(60), changes)
    assert LIB.hsp_restart(opened.handle) == OK  # the file's model is used, too
    other = hsp.load_experiment("panda_limits").controller.preview()
    run(other, opened, range(5), {})


def test_a_new_run_carries_nothing(tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    body = reported(1.0, [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    frame = next(at for at in opened.ports if at.endswith(".payload"))
    assert opened.set(frame, body) == OK  # before the first step: active from the start
    controller.at(-1.0).ramp(0.0).payload(frame.split(".")[0], 1.0, [0.0, 0.0, 0.1])
    run(controller, opened, range(5), {})
    assert LIB.hsp_restart(opened.handle) == OK
    other = hsp.load_experiment("panda_limits").controller.preview()
    run(other, opened, range(5), {})


@pytest.mark.parametrize(
    ("mass", "moments"),
    [
        (-1.0, [0.0, 0.0, 0.0]),
        (np.nan, [0.0, 0.0, 0.0]),
        (1e300, [0.0, 0.0, 0.0]),
        (1.0, [0.1, 0.1, 0.3]),  # one moment exceeds the sum of the others
        (1.0, [-0.1, 0.1, 0.1]),
        (0.0, [0.1, 0.1, 0.1]),  # without mass
    ],
)
def test_impossible_bodies_are_refused(
    mass: float, moments: list[float], tmp_path: Path
) -> None:
    _, opened = pair("panda_limits", tmp_path)
    frame = next(at for at in opened.ports if at.endswith(".payload"))
    body = reported(mass, [0.0, 0.0, 0.1], moments)
    assert opened.set(frame, body) == WRONG_VALUE
    assert opened.set("gravity", [0.0, 0.0, -981.0]) == WRONG_VALUE


def test_only_moving_links_carry(tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    assert "panda_tcp.payload" in opened.ports
    with pytest.raises(FreezeError, match=r"^payloads: .* is fixed to the world"):
        hsp.freeze(controller, tmp_path / "other.hsp", payloads=["panda_link0"])


def test_too_many_payloads_at_a_time(tmp_path: Path) -> None:
    controller, opened = pair("panda_limits", tmp_path)
    frame = next(at for at in opened.ports if at.endswith(".payload"))
    body = reported(1.0, [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    run(controller, opened, range(1), {})
    for _ in range(8):
        assert opened.ramp(frame, body, 0.1) == OK
    assert opened.ramp(frame, body, 0.1) == TOO_MANY
