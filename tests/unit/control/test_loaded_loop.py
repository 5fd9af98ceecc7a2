"""The closed loop with an unmodelled load."""

import re
from typing import Any

import numpy as np
import pytest
from compensators import ALONE, only
from places import THOROUGH

import hsp_control as hsp
from hsp_control.control.compensation import (
    Compensation,
    IntegralAction,
    MomentumObserver,
    VelocityFilter,
    check_rate,
)
from hsp_control.control.compensation.linear_loop import (
    NO_GAINS,
    LinearLoop,
    LoadedLoop,
    loaded_loop,
)
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants.model_changes import Payload, changed
from hsp_control.simulation.plants.sensors import SensorDelay

ARM = hsp.Robot.load("panda", gravity=[0.0, 0.0, 0.0])
Q0 = np.array([0.0, -0.5, 0.1, -2.0, 0.2, 1.6, 0.7])
H, MASS = 1e-3, 3.0


def holding(
    field: hsp.NullSpaceField | None = None, frequency: float = 20.0
) -> hsp.Controller:
    position = ARM.state(0.0, Q0, np.zeros(7)).position("panda_tcp")
    gains = hsp.Gains(natural_frequency=frequency)
    hand = hsp.FramePosition("panda_tcp", hsp.Hold(position), gains=gains, name="hand")
    field = hsp.TargetPosture(Q0) if field is None else field
    return hsp.Controller(ARM, [hand], field, null_space_gain=10.0, limits=None)


def loaded(times: float = 1.0) -> hsp.Robot:
    return changed(ARM, [Payload(frame="panda_hand", mass=times * MASS)])


def whole(made: hsp.Controller, parts: Compensation, delay: int) -> LoadedLoop:
    state = ARM.state(0.0, Q0, np.zeros(7))
    chain = LinearLoop(*NO_GAINS, H, 0, delay, parts)
    found = loaded_loop(made, state, loaded(), chain)
    assert found is not None
    return found


def boundary(loop: LoadedLoop) -> float:
    """Return the fraction of the load at which the loop becomes unstable."""
    low, high = 0.01, 20.0
    assert loop.with_part(low).radius() < 1.0 < loop.with_part(high).radius()
    for _ in range(30):
        middle = np.sqrt(low * high)
        grows = loop.with_part(middle).radius() > 1.0 + 1e-9
        low, high = (low, middle) if grows else (middle, high)
    return float(low)


CASES: dict[str, tuple[dict[str, Any], int]] = {
    "integral action": ({"integral_action": IntegralAction(7.0)}, 0),
    "measured two periods late": ({"integral_action": IntegralAction(7.0)}, 2),
    "a slow observer": (
        {
            "integral_action": IntegralAction(10.0),
            "momentum_observer": MomentumObserver(2.0),
        },
        1,
    ),
    "a filter": (
        {
            "integral_action": IntegralAction(5.0),
            "velocity_filter": VelocityFilter(30.0),
        },
        0,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES if THOROUGH else ["measured two periods late"])
def test_the_robot_grows_and_decays_at_the_rate_of_the_linear_loop(case: str) -> None:
    """On both sides of the boundary, with the load that the linear loop predicts.

    A point mass: the difference of the mass matrices is linear in it.
    """
    parts, delay = only(**CASES[case][0]), CASES[case][1]
    made = holding()
    loop = whole(made, parts, delay)
    edge = boundary(loop)
    start = ARM.integrate(Q0, 1e-6 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 0.0]))
    for times, grows in ((0.8 * edge, False), (1.25 * edge, True)):
        plant = hsp.plants.ImperfectPlant(
            hsp.plants.IntegratedPlant(
                hsp.plants.RigidBodyPlant(loaded(times)), Rk4(H)
            ),
            [SensorDelay(delay)],
        )
        log = hsp.simulate(
            made, start, duration=6.0, control_period=H, log_period=0.01, plant=plant,
            compensation=parts, check_rate=False,
        )  # fmt: skip
        error = np.linalg.norm(log["task.hand.error"], axis=1)
        windows = [error[k : k + 100].max() for k in (200, 300, 400, 500)]
        assert bool(windows[-1] > windows[0]) is grows
        if grows:  # the growing mode dominates all others
            rate = np.log(loop.with_part(times).radius()) / H
            found = np.polyfit([0.0, 1.0, 2.0, 3.0], np.log(windows), 1)[0]
            assert found == pytest.approx(rate, rel=0.1, abs=0.05)


def test_the_reported_limit_is_the_boundary_and_the_advice_works() -> None:
    made, strong = holding(), only(integral_action=IntegralAction(7.0))
    edge = boundary(whole(made, strong, 0))
    (found,) = check_rate(made, Q0, H, strong, plant=loaded())
    assert found.path == ("compensation", "integral_action")
    assert not found.unstable
    reported = re.fullmatch(
        r"the plant's bodies .* is (.*) times as heavy .* differ (.*) times as much; "
        r".* 1\.5 .* Ki of at most (.*) times this or .*observer",
        found.message,
    )
    assert reported is not None, found.message
    state, true = ARM.state(0.0, Q0, np.zeros(7)), loaded()
    J = state.frame("panda_tcp").jacobian[:3]
    # For the identity metric J# = Jᵀ (J Jᵀ)⁻¹: β from the two mass matrices.
    M, heavy = state.mass_matrix, true.state(0.0, Q0, np.zeros(7)).mass_matrix
    performed = J @ np.linalg.solve(heavy, M @ np.linalg.pinv(J))
    beta = np.linalg.eigvals(performed).real.min()
    assert float(reported[1]) == pytest.approx(1.0 / beta, rel=5e-3)
    assert float(reported[2]) == pytest.approx(edge, rel=5e-3)
    weaker = IntegralAction(7.0 * float(reported[3]))
    assert not check_rate(made, Q0, H, only(integral_action=weaker), plant=loaded())
    observed = Compensation(
        integral_action=IntegralAction(7.0), momentum_observer=MomentumObserver(50.0)
    )
    assert not check_rate(made, Q0, H, observed, plant=loaded())
    assert not check_rate(made, Q0, H, strong, plant=ARM)
    assert not check_rate(made, Q0, H, strong)
    (worse,) = check_rate(made, Q0, H, strong, plant=loaded(1.2 * edge))
    assert "motion grows by a factor of up to 1.000" in worse.message
    assert worse.radius > 1.0


def test_configurations_with_a_payload_are_warned_of_it() -> None:
    """Stable with 2 kg at a rate of 5 1/s; unstable with 3 kg, its payload, at 7.

    Without gravity; with it, uncontrolled self-motion diverges with any load.
    """
    document: dict[str, Any] = {
        "robot": {"name": "panda", "gravity": [0.0, 0.0, 0.0]},
        "tasks": {
            "hand": {
                "type": "frame_position",
                "frame": "panda_tcp",
                "trajectory": {"type": "hold"},
                "gains": {"natural_frequency": 20},
            }
        },
        "null_space": {"gain": 10},
        "compensation": {"integral_action": {"rate": 5}, "momentum_observer": None},
        "plant": {"type": "rigid_body", "payload": {"frame": "panda_hand", "mass": 2}},
        "simulation": {"duration": 0.02, "control_period": H},
    }
    assert not hsp.load_experiment(document).rate_findings
    heavier = "plant.payload.mass=3", "compensation.integral_action.rate=7"
    (found,) = hsp.load_experiment(document, *heavier).rate_findings
    assert "it is 5.26 times as heavy at the tasks" in found.message
    driven = document | {"compensation": {}, "simulation": {"duration": 0.02}}
    assert not hsp.load_experiment(driven, "plant.payload.mass=3").rate_findings


def test_an_unbalanced_weight_is_reported_and_an_observer_holds_it() -> None:
    """As predicted, the posture diverges or stays."""
    arm = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", gains=hsp.Gains(natural_frequency=20.0))
    true = changed(arm, [Payload(frame="panda_hand", mass=1.0)])
    made = hsp.Controller(arm, [hand], limits=None, start=Q0)
    (found,) = check_rate(made, Q0, H, plant=true)
    assert found.path == ("compensation", "momentum_observer")
    assert re.search(
        r"leaves the start as exp\(0\.\d+ t\); use a momentum", found.message
    )
    assert not check_rate(made, Q0, H, Compensation(), plant=true)
    held = hsp.Controller(arm, [hand], 5.0 * hsp.TargetPosture(Q0), start=Q0)
    assert not check_rate(held, Q0, H, plant=true)

    def away(compensation: Compensation) -> float:
        log = hsp.simulate(
            made, Q0, duration=2.0, control_period=H, log_period=0.01,
            compensation=compensation, plant=hsp.plants.RigidBodyPlant(true),
            check_rate=False,
        )  # fmt: skip
        return float(np.abs(log.q[-1] - Q0).max())

    assert away(ALONE) > 0.2
    assert away(Compensation()) < 0.01
