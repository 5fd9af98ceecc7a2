"""A plant too heavy for its motors is reported, with a feasible value."""

import re
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli.main import main
from hsp_control.common.errors import HspControlError
from hsp_control.control.first_state import StartWarning
from hsp_control.simulation.heavy_plant import SLOW, heavy_plant
from hsp_control.simulation.plants import Inertias, Payload, RigidBody

ROBOT = hsp.Robot.load("panda")
HOME = ROBOT.home()


def reported(robot: hsp.Robot = ROBOT, **fields: Any) -> list[str]:
    return [*heavy_plant(RigidBody(**fields), robot, HOME)]


def payload(mass: float) -> dict[str, Any]:
    return {"payload": Payload("panda_tcp", mass)}


def scaled(**factors: float) -> dict[str, Any]:
    return {"inertias": Inertias(**factors)}


HEAVY: dict[str, tuple[Any, Any]] = {
    "plant.payload.mass is 1e+06 kg: gravity requires": (payload(1e6), payload),
    "plant.inertias.mass_factor is 1e+06: gravity requires": (
        scaled(mass_factor=1e6),
        lambda x: scaled(mass_factor=x),
    ),
    "plant.inertias.inertia_factor is 1e+06: ": (
        scaled(inertia_factor=1e6),
        lambda x: scaled(inertia_factor=x),
    ),
    "plant.motor_inertia is 1000: ": (
        {"motor_inertia": 1e3},
        lambda x: {"motor_inertia": x},
    ),
}


@pytest.mark.parametrize("rotors", [0.0, 0.1])
@pytest.mark.parametrize("words", HEAVY)
def test_the_number_in_the_message_would_do_and_a_larger_one_would_not(
    words: str, rotors: float
) -> None:
    """Also with rotors in the model, which a factor on the bodies does not change."""
    robot = hsp.Robot.load("panda", motor_inertia=rotors)
    fields, of = HEAVY[words]
    (message,) = reported(robot, **fields)
    assert message.startswith(words)
    most = float(re.search(r"at most ([\d.e+]+)", message).group(1))  # type: ignore[union-attr]
    assert reported(robot, **of(most)) == []
    assert reported(robot, **of(1.02 * most)) != []


def test_a_movable_plant_is_not_reported() -> None:
    assert reported() == []
    assert reported(**payload(3.0), **scaled(mass_factor=1.2, random_mass=0.2)) == []
    assert reported(motor_inertia=0.3) == []
    # A robot without effort limits is not checked.
    arm = hsp.Robot.load("planar3r")
    plant = RigidBody(motor_inertia=1e3)
    assert [*heavy_plant(plant, arm, arm.home())] == []
    # The fields are checked separately.
    both = reported(**payload(30.0), motor_inertia=1e3)
    assert [each.split(" is ")[0] for each in both] == [
        "plant.payload.mass",
        "plant.motor_inertia",
    ]


def test_a_simulation_and_the_command_line_report_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    controller = hsp.Controller(ROBOT, [hsp.FramePosition("panda_tcp")], start=HOME)
    with pytest.warns(StartWarning, match=r"plant\.motor_inertia is 1000"):
        hsp.simulate(
            controller,
            HOME,
            duration=0.01,
            control_period=1e-3,
            plant=RigidBody(motor_inertia=1e3),
            check_rate=False,
        )
    set_ = ["--set", "plant={type: rigid_body, motor_inertia: 1e3}"]
    assert main(["check", "panda_limits", *set_]) == 0
    message = capsys.readouterr().err
    assert "hsp: plant.motor_inertia is 1000: " in message
    assert f"takes {1e3 * 2.61 / 12:.3g} s to its speed limit" in message
    assert SLOW == 10.0


@pytest.mark.parametrize("mass", [-1.0, 0.0, np.nan, np.inf])
def test_a_load_below_zero_is_refused(mass: float) -> None:
    with pytest.raises(HspControlError, match=r"mass: .* (greater than 0|finite)"):
        Payload("panda_tcp", mass)
