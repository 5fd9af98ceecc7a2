"""Force feedback: the measured force converges at the rate K_i, within bounds."""

from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from runs import held
from wording import wording

from hsp_control import Controller, FrameOrientation, Gains, Limits
from hsp_control.common.errors import CompensationError
from hsp_control.constraints.contacts import CommandedForce, PointContact
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    ForceFeedback,
    MomentumObserver,
)
from hsp_control.simulation import Rollout
from hsp_control.simulation.plants import ContactPlant, Push, RigidContact
from hsp_control.trajectories import Schedule

TIP, H = "panda_tcp", 1e-3
OBSERVER = MomentumObserver(100.0, cancel=False)


def pressing(
    newtons: float | None = 20.0, limits: Limits | None = None, **options: Any
) -> Controller:
    force = None if newtons is None else CommandedForce(newtons)
    return Controller(
        panda(),
        [FrameOrientation(TIP, gains=Gains(natural_frequency=10.0), name="turn")],
        contacts=[PointContact(TIP, force=force, name="press", **options)],
        limits=limits,
    )


def run(
    controller: Controller, compensation: Compensation, unknown: float, **options: Any
) -> Rollout:
    """Hold a hand against a rigid plane while something else pushes it down."""
    push = Push(TIP, force=(0.0, 0.0, unknown), start=0.0, duration=10.0)
    plant = ContactPlant(panda(), [RigidContact(TIP, "point")], pushes=[push])
    duration = options.get("duration", 0.4)
    how = {"duration": duration, "log_period": 0.01, "plant": plant}
    return held(controller, panda().home(), compensation=compensation, **how)


def test_the_error_decays_at_its_rate() -> None:
    """A rigid plane reacts at once, so λ_d - λ_m decays as (1 - K_i h)^n."""
    feedback = Compensation(force_feedback=ForceFeedback(8.0))
    log = run(pressing(), feedback, 5.0)
    felt = log[f"plant.contact.{TIP}.force"][:, 2]
    steps = log.t / H
    expected = 20.0 - 5.0 * (1.0 - 8.0 * H) ** np.maximum(steps - 1.0, 0.0)
    np.testing.assert_allclose(felt[1:], expected[1:], atol=0.05)
    np.testing.assert_allclose(log["contact.press.measured"][2:], felt[2:], atol=0.05)
    assert log["contact.press.integral"][-1] == pytest.approx(
        log["contact.press.commanded"][-1, 2] - 20.0, abs=0.05
    )
    assert np.abs(log["task.turn.error"]).max() < 1e-6


def test_the_integral_rests_where_the_command_is_reduced() -> None:
    """A motor at its limit cannot press harder: nothing winds up."""
    state = panda().state(0.0, panda().home(), np.zeros(7))
    holding = np.abs(state.nonlinear_effects) + 5.0
    limits = Limits(effort=holding, velocity="none", position="none")
    feedback = Compensation(force_feedback=ForceFeedback(50.0))
    log = run(pressing(60.0, limits), feedback, 0.0)
    commanded = log["contact.press.commanded"][:, 2]
    assert (log["contact.press.force"][5:, 2] < commanded[5:] - 5.0).all()
    assert np.abs(log["contact.press.integral"]).max() < 1.0


def test_the_integral_waits_until_the_contact_carries() -> None:
    feedback = Compensation(force_feedback=ForceFeedback(8.0))
    fading = Schedule([(0.1, None)], ramp=0.1)
    log = run(pressing(schedule=fading), feedback, 5.0)
    integral = log["contact.press.integral"]
    assert not integral[log.t < 0.19].any()
    assert integral[-1] > 1.0


def test_an_estimate_needs_no_sensor() -> None:
    """Zero force in the air; the commanded force on a plane with an exact model."""
    feedback = ForceFeedback(1e-6, force="estimated")
    both = Compensation(force_feedback=feedback, momentum_observer=OBSERVER)
    log = run(pressing(), both, 0.0)
    assert log["contact.press.estimated"][-1] == pytest.approx(20.0, abs=0.1)
    assert np.abs(log["observer.disturbance"][-1]).max() < 0.1
    how: dict[str, Any] = {"duration": 0.1, "log_period": 0.01}
    air = held(pressing(), panda().home(), compensation=both, **how)
    assert air["contact.press.estimated"][-1] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(
    ("newtons", "parts", "message"),
    [
        (
            None,
            {"force_feedback": ForceFeedback()},
            "... force_feedback: ... no contact",
        ),
        (
            20.0,
            {"force_feedback": ForceFeedback(contacts=["pres"])},
            "... no ... 'pres' ... 'press'",
        ),
        (
            20.0,
            {"force_feedback": ForceFeedback(force="estimated")},
            "... force_feedback.force: 'estimated' ... momentum_observer",
        ),
        (
            20.0,
            {"momentum_observer": MomentumObserver(50.0, clip=5.0)},
            "... momentum_observer: ... contact 'press'",
        ),
    ],
)
def test_impossible_feedback(
    newtons: float | None, parts: dict[str, Any], message: str
) -> None:
    with pytest.raises(CompensationError, match=wording(message)):
        CompensatedController(pressing(newtons), Compensation(**parts))
