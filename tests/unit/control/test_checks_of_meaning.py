"""Implausible input is reported where it occurs: mm, degrees, a damped run."""

import warnings

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.errors import HspControlError, LimitError
from hsp_control.control.clock_check import ClockWarning
from hsp_control.control.first_state import StartWarning
from hsp_control.simulation.simulate import RunWarning

PANDA = hsp.Robot.load("panda")
REST = np.zeros(7)


def warnings_of(target: object, **options: object) -> list[str]:
    """Warnings about a target at the start of a loop."""
    task = hsp.FramePosition("panda_tcp", target, name="hand", **options)  # type: ignore[arg-type]
    controller = hsp.Controller(PANDA, [task])
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        controller.compute(0.0, PANDA.home(), REST)
        controller.compute(0.001, PANDA.home(), REST)
    assert {each.filename for each in found} <= {__file__}
    return [str(each.message) for each in found]


@pytest.mark.parametrize(
    ("target", "options", "warning"),
    [
        ([0.4, 0.2, 0.5], {}, ""),
        ([1.5, 0.0, 0.5], {}, ""),  # out of reach, which may be intended
        ([3.0, 0.0, 0.5], {}, "the robot reaches 1.1 m: it goes as near"),
        ([400.0, 200.0, 500.0], {}, "millimetres? Lengths are in m"),
        # begins at the current pose
        ([400.0, 200.0, 500.0], {"blend": 1.0}, "millimetres?"),
        ([500.0], {"axes": "z"}, "499.5 m away from 'panda_tcp'"),
        (hsp.Circle(radius=0.1, angular_rate=1.0), {}, ""),  # relative to the start
    ],
)
def test_a_target_far_out_of_reach_is_reported_once(
    target: object, options: dict[str, object], warning: str
) -> None:
    found = warnings_of(target, **options)
    assert len(found) == bool(warning)
    assert warning in "".join(found)


def test_a_target_that_is_set_is_looked_at_too() -> None:
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", name="hand")])
    controller.compute(0.0, PANDA.home(), REST)
    with pytest.warns(StartWarning, match="millimetres") as found:
        controller.set_target("hand", [400.0, 0.0, 500.0, 1.0, 0.0, 0.0, 0.0])
    assert [each.filename for each in found] == [__file__]
    controller.set_target("hand", [0.4, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])  # no warning


@pytest.mark.filterwarnings("error")
def test_a_mostly_damped_run_is_reported() -> None:
    out = hsp.FramePosition("panda_tcp", [1.5, 0.0, 0.5], blend=1.0, name="hand")
    controller = hsp.Controller(PANDA, [out])
    options = {"duration": 4.0, "control_period": 0.005}
    with pytest.warns(
        RunWarning, match=r"damped in \d+ of 401 rows.*'hand': "
    ) as warnings_of:
        run = hsp.simulate(controller, PANDA.home(), **options)  # type: ignore[arg-type]
    assert str(int((run["damped"] > 0.0).sum())) in str(warnings_of[0].message)
    near = hsp.FramePosition("panda_tcp", blend=1.0)
    hsp.simulate(hsp.Controller(PANDA, [near]), PANDA.home(), **options)  # type: ignore[arg-type]


def test_degrees_are_named_in_python_and_in_yaml(
    capsys: pytest.CaptureFixture[str],
) -> None:
    degrees = [0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0]
    controller = hsp.Controller(PANDA, [hsp.FramePosition("panda_tcp")])
    with pytest.raises(HspControlError, match="degrees"):
        controller.compute(0.0, degrees, REST)
    with pytest.raises(HspControlError, match=r"^start: .*degrees"):
        hsp.Controller(PANDA, [hsp.FramePosition("panda_tcp")], start=degrees)
    with pytest.raises(HspControlError, match=r"^changes contains 'x'"):
        hsp.Controller(PANDA, [], changes=["x"])  # type: ignore[list-item]
    three = hsp.Gains(natural_frequency=[1.0, 2.0, 3.0])
    with pytest.raises(HspControlError, match="natural_frequency has 3 entries; "):
        hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", gains=three)])
    limits = controller.limits
    assert limits is not None
    with pytest.raises(LimitError, match=r"at -45, .*degrees\? Angles are in rad"):
        limits.check_start(np.array(degrees), REST)
    a_little = PANDA.home()
    a_little[1] = 1.8  # beyond the limit, in rad
    with pytest.raises(LimitError, match=r"1\.7628$"):
        limits.check_start(a_little, REST)
    given = f"start={{configuration: {degrees}}}"
    assert main(["check", "panda_limits", "--set", given]) == 2
    assert "degrees? Angles are in rad" in capsys.readouterr().err


def test_a_recorded_loop_whose_times_are_milliseconds_is_warned_of() -> None:
    """No period is given; the first step reveals the unit."""
    controller = hsp.Controller(PANDA, [hsp.FramePosition("panda_tcp")])
    recorder = hsp.Recorder(controller)
    recorder.record(controller.compute(0.0, PANDA.home(), REST))
    with pytest.warns(ClockWarning, match=r"1 s apart: milliseconds\? Times are in s"):
        recorder.record(controller.compute(1.0, PANDA.home(), REST))
    recorder.close()


def test_the_command_line_prints_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    far = "tasks.hand.trajectory={type: hold, point: [400, 200, 500]}"
    kind = "tasks.hand.type=frame_position"
    code = main(["check", "panda_limits", "--set", kind, "--set", far])
    assert code == 0, capsys.readouterr().err
    assert "millimetres? Lengths are in m" in capsys.readouterr().err
