"""Invalid targets, bounds and messages: refused, or without a jump."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli.main import main
from hsp_control.common.errors import HspControlError, StreamError
from hsp_control.control.first_state import StartWarning
from hsp_control.trajectories import CallableTrajectory

NAN, FAR = math.nan, 1e6
HAND = "panda_tcp"
ROBOT = hsp.Robot.load("panda")
HOME = ROBOT.home()


def controller(reference: Any, **options: Any) -> hsp.Controller:
    blend = None if isinstance(reference, hsp.Stream) else 0.5
    hand = hsp.FramePosition(HAND, reference, name="hand", blend=blend)
    return hsp.Controller(ROBOT, [hand], start=HOME, **options)


def run(law: hsp.Controller, duration: float = 0.3) -> hsp.Rollout:
    return hsp.simulate(
        law, HOME, duration=duration, control_period=1e-3, log_period=1e-3
    )


def here() -> hsp.Hold:
    return hsp.Hold([0.0, 0.0, 0.0], origin="start")


def assert_no_jump(law: hsp.Controller) -> None:
    """Efforts are within their limits, and change by no more than their rate."""
    limits = law.limits
    assert limits is not None
    tau = run(law).tau
    assert np.isfinite(tau).all()
    assert (np.abs(tau) <= limits.effort + 1e-9).all()
    assert (np.abs(np.diff(tau, axis=0)) <= 1e-3 * limits.effort_rate + 1e-9).all()


def step(t: float, value: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    away = value if t > 0.1 else 0.4
    return np.array([away, 0.0, 0.5])


# --- NaN and infinity ---------------------------------------------------------------

BOUNDS = ("effort", "effort_rate", "velocity", "acceleration", "bandwidth")
NONE = [(0, "0 is too small"), (-1, "-1 is negative"), (NAN, "nan is not a fin")]


@pytest.mark.parametrize(("value", "why"), NONE)
@pytest.mark.parametrize("name", BOUNDS)
def test_a_bound_that_is_none_is_refused(name: str, value: float, why: str) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(HspControlError, match=f"^Limits: {name}: {why}"):
        hsp.Limits(**options)
    with pytest.raises(HspControlError, match=f"^FramePosition: largest_error: {why}"):
        hsp.FramePosition(HAND, here(), largest_error=value)


@pytest.mark.parametrize("value", [NAN, math.inf])
def test_a_target_that_is_none_is_refused(value: float) -> None:
    why = r"(nan|inf) is not a finite number$"
    with pytest.raises(HspControlError, match=r"^Hold: point\.0: " + why):
        hsp.Hold([value, 0.0, 0.0])
    posture = [value, *HOME[1:]]
    with pytest.raises(HspControlError, match=r"^JointPosture: reference\.0: " + why):
        hsp.JointPosture(posture)
    with pytest.raises(HspControlError, match=r"^TargetPosture: target\.0: " + why):
        hsp.TargetPosture(posture)
    law = controller(hsp.Stream())
    stream = law.stream("hand")
    law.compute(0.0, HOME, np.zeros(7))
    for send in (
        lambda: stream.send([value, 0.0, 0.5]),
        lambda: stream.send([0.4, 0.0, 0.5], velocity=[value, 0.0, 0.0]),
        lambda: stream.send([0.4, 0.0, 0.5], t=value),
        lambda: stream.send_chunk([[value, 0.0, 0.5], [0.4, 0.0, 0.5]], [0.1, 0.2]),
    ):
        with pytest.raises(StreamError, match=r"nan|inf"):
            send()
    assert_no_jump(law)


YAML = """\
robot: {name: panda}
tasks:
  hand: {type: frame_position, frame: panda_tcp,
         trajectory: {type: hold, point: [0.4, 0, 0.5]}}
limits: {effort_rate: 1}
simulation: {duration: 0.01, control_period: 0.001}
"""


# --- infeasible numbers -------------------------------------------------------------


def to_reference(law: hsp.Controller, reference: Any) -> hsp.Controller:
    law.at(0.1).ramp(0.1).reference("hand", reference)
    return law


def sent(*values: Any) -> hsp.Controller:
    law = controller(hsp.Stream())
    stream = law.stream("hand")
    law.compute(0.0, HOME, np.zeros(7))
    if len(values) == 1:
        stream.send(values[0])
    else:
        stream.send_chunk(list(values), 0.1 * np.arange(1, 1 + len(values)))
    return law


AWAY: dict[str, Callable[[], hsp.Controller]] = {
    "target": lambda: controller(hsp.Hold([FAR, 0.0, 0.5])),
    "function": lambda: controller(
        CallableTrajectory(lambda t: step(t, FAR), dimension=3)
    ),
    "change": lambda: to_reference(controller(here()), hsp.Hold([FAR, 0.0, 0.5])),
    "posture": lambda: hsp.Controller(
        ROBOT, [hsp.JointPosture([FAR, *HOME[1:]])], start=HOME
    ),
    "message": lambda: sent([FAR, 0.0, 0.5]),
    "chunk": lambda: sent([FAR, 0.0, 0.5], [0.4, 0.0, 0.5]),
    "field": lambda: hsp.Controller(
        ROBOT,
        [hsp.FramePosition(HAND, here())],
        hsp.TargetPosture([FAR, *HOME[1:]]),
        start=HOME,
    ),
    "effort": lambda: controller(here(), limits=hsp.Limits(effort=1e-9)),
    "velocity": lambda: controller(here(), limits=hsp.Limits(velocity=1e-9)),
}


@pytest.mark.parametrize("target", AWAY)
@pytest.mark.filterwarnings("ignore::hsp_control.control.first_state.StartWarning")
def test_infeasible_targets_make_no_effort_jump(target: str) -> None:
    assert_no_jump(AWAY[target]())


def test_a_rate_that_gravity_outruns_is_warned_of_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    message = r"may change by 1 N·m/s, but gravity by 70\.6 N·m/s at its speed limit"
    law = controller(here(), limits=hsp.Limits(effort_rate=1.0))
    with pytest.warns(StartWarning, match=message):
        assert_no_jump(law)
    path = tmp_path / "mine.yaml"
    path.write_text(YAML, encoding="utf-8")
    for command in ("check", "run"):
        assert main([command, str(path)]) == 0
        assert "gravity by 70.6 N·m/s" in capsys.readouterr().err
