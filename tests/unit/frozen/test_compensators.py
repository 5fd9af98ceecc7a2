"""Compensators without Python: efforts of `CompensatedController` to the last bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_runs import commanded, random_states, replayed

import hsp_control as hsp
from hsp_control.common.errors import CompensationError, FreezeError

SEED = 61
PARTS = hsp.compensation


@pytest.mark.smoke
@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("panda_limits", {}),  # auto: an observer
        ("panda_limits", {"momentum_observer": PARTS.MomentumObserver(40.0)}),
        (
            "compliance/panda_joint_impedance",
            {"momentum_observer": PARTS.MomentumObserver(cancel=False, order=2)},
        ),
        ("ur5_position", {"velocity_filter": PARTS.VelocityFilter(40.0, 2)}),
        (
            "ur5_position",
            {
                "momentum_observer": None,
                "velocity_filter": PARTS.VelocityFilter(60.0),
                "start_up_ramp": PARTS.StartUpRamp(0.1, 3.0),
                "integral_action": PARTS.IntegralAction(1.0, limit=1.0),
            },
        ),
        # continuous joints, no limits
        ("paper/2_rest", {"start_up_ramp": PARTS.StartUpRamp(0.1, 3.0)}),
        ("panda_limits", {"momentum_observer": None}),  # none
    ],
)
def test_the_same_bits(
    name: str, parts: dict[str, Any], replay: Path, tmp_path: Path
) -> None:
    experiment = hsp.load_experiment(name)
    controller, compensation = experiment.controller, PARTS.Compensation(**parts)
    path = tmp_path / "frozen.hsp"
    hsp.freeze(controller, path, compensation=compensation)
    for away, speed in ((0.01, 0.02), (0.5, 0.5)):
        given = controller.robot, experiment.q0, 200, SEED
        states = random_states(*given, away=away, speed=speed)
        np.testing.assert_array_equal(
            replayed(replay, path, states), commanded(controller, compensation, states)
        )


@pytest.mark.parametrize(
    ("parts", "key"),
    [
        ({"predictor": PARTS.Predictor(1)}, "predictor"),
        ({"friction_feed_forward": "urdf"}, "friction_feed_forward"),
    ],
)
def test_a_compensator_in_python_is_refused_with_its_key(
    parts: dict[str, Any], key: str, tmp_path: Path
) -> None:
    controller = hsp.load_experiment("panda_limits").controller
    compensation = PARTS.Compensation(**parts)
    with pytest.raises(FreezeError, match=rf"^compensation\.{key}: .* in Python"):
        hsp.freeze(controller, tmp_path / "frozen.hsp", compensation=compensation)


def test_unsuitable_input_is_refused(tmp_path: Path) -> None:
    controller = hsp.load_experiment("panda_limits").controller
    compensation = PARTS.Compensation(integral_action=PARTS.IntegralAction(ki={"x": 1}))
    with pytest.raises(
        CompensationError, match=r"^compensation\.integral_action\.ki: .*'x'"
    ):
        hsp.freeze(controller, tmp_path / "frozen.hsp", compensation=compensation)
