"""A step of a frozen controller allocates nothing, and makes no system call."""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pytest
from frozen_runs import compiled, random_states, simulated_states

import hsp_control as hsp
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.trajectories import StreamPose

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="glibc's names, Linux' seccomp"),
    pytest.mark.skipif(
        "libasan" in os.environ.get("LD_PRELOAD", ""),
        reason="AddressSanitizer replaces malloc, and makes system calls",
    ),
]
SEED = 61
Policy = Literal["latest", "interpolate", "extrapolate"]


@pytest.mark.smoke
@pytest.mark.parametrize(
    "name",
    ["panda_obstacle", "panda_limits", "ur5_position", "whole_body/solo12_trunk"],
)
def test_no_allocation_no_lock_no_system_call(name: str, tmp_path: Path) -> None:
    experiment = hsp.load_experiment(name)
    inputs = ("limit_barrier.weight",) if name == "panda_limits" else ()
    check_quiet(experiment, experiment.controller, tmp_path, *inputs)


@pytest.mark.smoke
@pytest.mark.parametrize("policy", get_args(Policy))
def test_targets_are_planned_for_without_any(policy: Policy, tmp_path: Path) -> None:
    experiment = hsp.load_experiment("panda_obstacle")
    stream = StreamPose(policy=policy, delay=0.03, smoothing=0.02, dead_man=0.02)
    hand = hsp.FramePose("panda_tcp", stream, name="hand")
    start = experiment.q0
    controller = hsp.Controller(experiment.robot, [hand], start=start)
    inputs = "target_time", "target_velocity", "target", "velocity"
    check_quiet(experiment, controller, tmp_path, *(f"hand.{x}" for x in inputs))


def test_a_spring_follows_without_any(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("panda_obstacle")
    soft = hsp.Impedance([300.0, 400.0, 500.0])
    hand = hsp.FramePosition("panda_tcp", impedance=soft, name="hand")
    start = experiment.q0
    controller = hsp.Controller(experiment.robot, [hand], start=start)
    inputs = "hand.stiffness", "hand.damping_ratio"
    check_quiet(experiment, controller, tmp_path, *inputs)


def test_tasks_come_and_go_without_any(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("panda_obstacle")
    hand = hsp.FramePosition("panda_tcp", name="hand")
    turn = hsp.FrameOrientation("panda_tcp", name="turn", priority=2)
    start = experiment.q0
    controller = hsp.Controller(experiment.robot, [hand, turn], start=start)
    inputs = "hand.presence", "turn.presence", "gravity"
    check_quiet(experiment, controller, tmp_path, *inputs, come_and_go=["hand", "turn"])


def test_a_sliding_contact_presses_without_any(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("forces/panda_wipe")
    own = experiment.controller
    wiper = replace(own.contacts[0], force=CommandedForce(value=5.0))
    given: dict[str, Any] = {"contacts": (wiper,), "start": experiment.q0}
    controller = hsp.Controller(own.robot, own.tasks, own.field, **given)
    check_quiet(experiment, controller, tmp_path, "wiper.force")


def check_quiet(
    experiment: hsp.Experiment,
    controller: hsp.Controller,
    tmp_path: Path,
    *sent: str,
    come_and_go: Sequence[str] = (),
) -> None:
    program = compiled(Path(__file__).with_name("quiet.c"), tmp_path)
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp", presences=come_and_go)
    # with no limit violated, and with contradicting violated ones
    calm = simulated_states(experiment, 0.1)
    given = experiment.robot, experiment.q0, 100, SEED
    wild = random_states(*given, away=0.5, speed=0.5)
    wild[:, 0] += calm[-1, 0] + 0.001
    states = np.concatenate([calm, wild])
    file = tmp_path / "states"
    file.write_bytes(states.tobytes())
    command = [program, frozen, file, str(len(states)), "20", *sent]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    steps, within, allocations, locks, *_ = (
        int(word) for word in done.stdout.split() if word.isdigit()
    )
    assert steps == 20 * len(states)
    assert 0 < within < steps
    assert allocations == locks == 0
    if "without system calls" not in done.stdout:
        pytest.skip("allocations and locks were checked; seccomp is not allowed here")
