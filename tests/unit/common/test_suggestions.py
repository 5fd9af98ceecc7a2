"""Check which name is suggested for one that does not exist."""

import inspect

import pytest
from wording import wording

import hsp_control as hsp
from hsp_control.common.suggestions import did_you_mean, nearest


def test_the_nearest_name_is_suggested() -> None:
    frames = ["universe", "panda_link7", "panda_hand", "panda_hand_tcp"]
    assert did_you_mean("panda_hnad", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("hand", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("UNIVERSE", frames) == "; did you mean 'universe'?"
    assert did_you_mean("xyz", frames) == ""
    assert nearest("", frames) is None
    assert nearest("a", []) is None


def test_an_unknown_argument_is_named_with_the_nearest_one() -> None:
    """On the controller and the objects it returns; their signatures are unchanged."""
    reported = "Controller: ... 'nullspace_gain' ... 'null_space_gain' ... robot, tasks"
    with pytest.raises(TypeError, match=wording(reported)):
        hsp.Controller(nullspace_gain=3)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^Recorder: unknown argument 'log_perod'"):
        hsp.Recorder(None, log_perod=1)  # type: ignore[call-arg]
    for call, wrong, meant in (
        (hsp.simulate, "durations", "duration"),
        (hsp.load_experiment, "stric", "strict"),
        (hsp.Robot.load, "gravty", "gravity"),
        (hsp.Robot.from_pinocchio, "tool_frame", "tool_frames"),
        (hsp.freeze, "perid", "period"),
        (hsp.run_loop, "duraton", "duration"),
    ):
        output = (
            rf"^{call.__qualname__}: unknown argument '{wrong}'; did you mean '{meant}'"
        )
        with pytest.raises(TypeError, match=output):
            call(**{wrong: 1})
    with pytest.raises(TypeError, match=r"^Controller: missing .* 'tasks' "):
        hsp.Controller(None)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^Controller: too many positional arguments"):
        hsp.Controller(None, [], None, 3.0)  # type: ignore[misc]
    assert "robot" in inspect.signature(hsp.Controller).parameters
