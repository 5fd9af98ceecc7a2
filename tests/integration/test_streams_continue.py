"""Copies, pickles and previews of a controller continue a stream bit for bit."""

import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import covering

import hsp_control as hsp
from hsp_control.tasks import RelativePose
from hsp_control.trajectories import ComposedPose

PERIOD = 2e-3
PANDA = hsp.Robot.load("panda")
Q, V = PANDA.home(), np.zeros(7)
POLICIES = ("latest", "interpolate", "extrapolate")
KINDS = ("position", "orientation", "pose", "tool", "relative", "pointing", "joints")
FIRST, LAST = 60, 130  # steps; it is copied after the first ones


def law(kind: str, policy: Any) -> hsp.Controller:
    """Return a controller with one streamed task, ``hand``."""
    how: dict[str, Any] = {"policy": policy, "smoothing": 0.03, "hold_after": 0.09}
    pose = hsp.StreamPose(**how, axes="tool" if kind == "tool" else "world")
    turn = hsp.StreamOrientation(**how, axes="tool")
    point = hsp.Stream(**how)
    tasks: dict[str, Any] = {
        "position": lambda: hsp.FramePosition("panda_tcp", point, name="hand"),
        "orientation": lambda: hsp.FrameOrientation("panda_tcp", turn, name="hand"),
        "pose": lambda: hsp.FramePose("panda_tcp", pose, name="hand"),
        "tool": lambda: hsp.FramePose("panda_tcp", pose, name="hand"),
        "relative": lambda: RelativePose(
            "panda_tcp", pose, reference="panda_link2", name="hand"
        ),
        "pointing": lambda: hsp.Pointing("panda_tcp", trajectory=turn, name="hand"),
        "joints": lambda: hsp.JointPosture([0.0] * 7, displacement=point, name="hand"),
    }
    return hsp.Controller(PANDA, [tasks[kind]()], limits=None)


def send(controller: hsp.Controller, kind: str, k: int) -> None:
    """Send the messages before step k: targets, chunks, velocities, out of order."""
    if k % 9:
        return
    stream = controller.stream("hand")
    rng, t = np.random.default_rng(k), PERIOD * k - (0.03 if k % 4 == 0 else 0.0)
    turns = kind not in ("position", "joints")
    point = Q if kind == "joints" else np.array([0.3, 0.0, 0.5])
    if kind in ("orientation", "pointing"):
        point = np.zeros(0)

    def near() -> np.ndarray:
        turned = pin.Quaternion(pin.exp3(0.2 * rng.normal(size=3))).coeffs()
        moved = point + 0.02 * rng.normal(size=len(point))
        return np.concatenate([moved, turned]) if turns else moved

    rates = 0.1 * rng.normal(size=len(point) + 3 * turns)
    what = (k // 9) % 4
    if what == 0:
        stream.send(near(), t=t)
    elif what == 1:
        stream.send_chunk([near() for _ in range(4)], [0.02, 0.05, 0.09, 0.2], t=t)
    elif what == 2:
        stream.send(velocity=rates, t=t)
    else:
        stream.send(near(), velocity=rates, t=t)


def steps(controller: hsp.Controller, kind: str, which: Sequence[int]) -> list[bytes]:
    """Return the efforts of some steps, as bytes."""
    found = []
    for k in which:
        send(controller, kind, k)
        found.append(controller.compute(PERIOD * k, Q, V).tau.tobytes())
        controller.applied(np.zeros(7), PERIOD)
    return found


def amid(kind: str, policy: str) -> hsp.Controller:
    """Return a controller after some steps, with a waiting message."""
    controller = law(kind, policy)
    steps(controller, kind, range(FIRST))
    size = {"joints": 7, "pose": 6, "tool": 6, "relative": 6}.get(kind, 3)
    velocity = 0.05 * np.ones(size)
    controller.stream("hand").send(velocity=velocity)  # not read yet
    return controller


CASES = covering(KINDS, POLICIES)
every_case = pytest.mark.parametrize(("kind", "policy"), CASES)


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    """Return the efforts of pickles that continue in another process, by case."""
    file = tmp_path_factory.mktemp("amid") / "controllers.pkl"
    cases = {f"{k} {p}": pickle.dumps(amid(k, p)) for k, p in CASES}
    file.write_bytes(pickle.dumps(cases))
    command = [sys.executable, __file__, str(file)]
    path = os.pathsep.join(filter(None, sys.path))  # of this file's own imports
    done = subprocess.run(
        command,
        check=True,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )
    found: dict[str, list[bytes]] = pickle.loads(done.stdout)
    return found


@every_case
def test_a_pickle_goes_on_elsewhere_to_the_last_bit(
    elsewhere: dict[str, list[bytes]], kind: str, policy: str
) -> None:
    expected = steps(amid(kind, policy), kind, range(FIRST, LAST))
    assert elsewhere[f"{kind} {policy}"] == expected
    assert len(set(expected)) > 50  # it was moving


@every_case
def test_copies_continue_and_previews_move_nothing(kind: str, policy: str) -> None:
    """An onlooker receives the original's messages; all are called in turn."""
    expected = steps(amid(kind, policy), kind, range(FIRST, LAST))
    controller = amid(kind, policy)
    copy, onlooker = deepcopy(controller), controller._copy()
    found, copied, looked = [], [], []
    for k in range(FIRST, LAST):
        if k % 20 == 5:
            controller.flow(PERIOD * k + 0.5, Q)
            controller.stack(PANDA.state(PERIOD * k + 1.0, Q, V))
            preview = controller.preview()
            for t in np.linspace(0.0, 2.0, 20):
                preview.compute(t, Q, V)
            deepcopy(controller).compute(PERIOD * k + 3.0, Q, V)
            pickle.loads(pickle.dumps(controller)).compute(PERIOD * k + 3.0, Q, V)
        found += steps(controller, kind, [k])
        copied += steps(copy, kind, [k])
        looked.append(onlooker.compute(PERIOD * k, Q, V).tau.tobytes())
        onlooker.applied(np.zeros(7), PERIOD)
    assert found == expected
    assert copied == expected
    assert looked == expected


def leaving() -> hsp.Controller:
    """Return a controller whose task fades from a stream, from 0.3 to 2.3 s."""
    stream = hsp.StreamPose(delay=0.05, dead_man=1.0)
    controller = hsp.Controller(PANDA, [hsp.FramePose(None, stream)], limits=None)
    led(controller, 0, 30)
    controller.at(0.3).ramp(2.0).reference("end_effector", ComposedPose())
    return controller


def led(controller: hsp.Controller, first: int, last: int) -> list[np.ndarray]:
    """Return the efforts of steps of 10 ms while the stream continues."""
    found = []
    for k in range(first, last):
        if k % 5 == 0:
            turn = 0.2 * np.sin(k * np.ones(3))
            for stream in controller.streams:  # none once the task has left it
                stream.send(velocity=np.concatenate([0.1 * turn, turn]))
        found.append(controller.compute(0.01 * k, Q, V).tau.copy())
        controller.applied(np.zeros(7), 0.01)
    return found


def test_a_task_that_leaves_a_stream_goes_on_in_copies_and_beside_other_changes() -> (
    None
):
    """A second later the stream still has the start of the change."""
    expected = np.array(led(leaving(), 30, 250))
    for k in (31, 180, 240):
        controller = leaving()
        led(controller, 30, k)
        copy = pickle.loads(pickle.dumps(controller))
        np.testing.assert_array_equal(led(copy, k, 250), expected[k - 30 :])
        # The same gains again: all references are made anew, and (1 - s) Kp + s Kp.
        controller.at(0.0).gains("end_effector", hsp.Gains(natural_frequency=10.0))
        found = led(deepcopy(controller), k, 250)
        np.testing.assert_allclose(found, expected[k - 30 :], rtol=0, atol=1e-11)


if __name__ == "__main__":
    cases = pickle.loads(Path(sys.argv[1]).read_bytes())
    after = {
        name: steps(pickle.loads(each), name.split()[0], range(FIRST, LAST))
        for name, each in cases.items()
    }
    sys.stdout.buffer.write(pickle.dumps(after))
