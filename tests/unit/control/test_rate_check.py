"""Gains that a loop's rate permits: closed forms, the chain's parts, the robot."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from carriage import carriage, check_that_it_is_the_loop
from compensators import only
from runs import held
from wording import wording

import hsp_control as hsp
from hsp_control import (
    Controller,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Rest,
    Robot,
    load_experiment,
    simulate,
)
from hsp_control.cli.main import main
from hsp_control.common.errors import UnstableRateError
from hsp_control.control.compensation import (
    Compensation,
    IntegralAction,
    MomentumObserver,
    Predictor,
    VelocityFilter,
    check_rate,
)
from hsp_control.control.compensation.linear_loop import LinearLoop
from hsp_control.control.compensation.rate_check import null_space_rates
from hsp_control.null_space.fields import TargetPosture, Uncontrolled
from hsp_control.null_space.metrics import MassMatrixMetric
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import (
    ImperfectPlant,
    IntegratedPlant,
    RigidBodyPlant,
)
from hsp_control.simulation.plants.drives import EffortDelay, EffortLag
from hsp_control.simulation.plants.model_changes import Inertias, changed
from hsp_control.simulation.plants.sensors import SensorDelay

H = 1e-3
ONE, ZERO = np.eye(1), np.zeros((1, 1))


def pd(frequency: float, damping: float = 1.0, **options: Any) -> LinearLoop:
    kp, kv = frequency**2 * ONE, 2.0 * damping * frequency * ONE
    return LinearLoop(kp, kv, options.pop("ki", 0.0) * ONE, H, **options)


def rate(gain: float, **options: Any) -> LinearLoop:
    return LinearLoop(ZERO, gain * ONE, ZERO, H, **options)


@pytest.mark.parametrize(
    ("make", "limit"),
    [
        (rate, 2.0),
        (pd, 1.0),
        (lambda x: rate(x, effort_delay=1), 1.0),
        (lambda x: rate(x, sensor_delay=1), 1.0),
        (lambda x: rate(x, effort_delay=1, sensor_delay=1), (5**0.5 - 1.0) / 2.0),
        (lambda x: pd(x, effort_delay=1), 0.42616),
        (lambda x: pd(x, 0.7, effort_delay=1), 0.49501),
        (
            lambda x: pd(
                x, effort_delay=1, compensation=Compensation(predictor=Predictor())
            ),
            1,
        ),
        (
            lambda x: pd(
                x, effort_delay=2, sensor_delay=1,
                compensation=Compensation(predictor=Predictor(2, 1)),
            ),
            1.0,
        ),
        # K_N h + α h < 2 for a field whose slope equals the gain.
        (lambda x: LinearLoop(x * x * ONE, 2.0 * x * ONE, ZERO, H), 1.0),
    ],
)  # fmt: skip
def test_the_limits_of_theory(make: Any, limit: float) -> None:
    """Closed forms of the limits, in units of 1/h, to five digits."""
    assert make(limit * (1.0 - 1e-5) / H).radius() <= 1.0 + 1e-9
    assert make(limit * (1.0 + 1e-5) / H).radius() > 1.0 + 1e-7


@pytest.mark.parametrize("heavy", [1.0, 3.0])
@pytest.mark.parametrize(
    ("delays", "compensation"),
    [
        ((0, 0), {}),
        ((1, 0), {}),
        ((1, 2), {}),
        ((0, 0), {"velocity_filter": VelocityFilter(40.0)}),
        ((0, 0), {"velocity_filter": VelocityFilter(40.0, 2)}),
        ((1, 1), {"predictor": Predictor(1, 1)}),
        ((2, 0), {"predictor": Predictor(1, 0)}),
        ((1, 0), {"momentum_observer": MomentumObserver(50.0)}),
        ((0, 2), {"momentum_observer": MomentumObserver(15.0, order=2)}),
        ((0, 0), {"integral_action": IntegralAction(20.0)}),
        (
            (1, 1),
            {
                "velocity_filter": VelocityFilter(60.0),
                "predictor": Predictor(1, 0),
                "momentum_observer": MomentumObserver(30.0),
                "integral_action": IntegralAction(10.0),
            },
        ),
    ],
)
def test_the_linear_loop_is_the_chain_link_by_link(
    delays: tuple[int, int], compensation: dict[str, Any], heavy: float, tmp_path: Path
) -> None:
    """A carriage on a rail is the linear mode, also with a wrong mass."""
    robot = carriage(tmp_path)
    h, frequency = 0.01, 12.0
    task = JointPosture(np.zeros(1), gains=Gains(natural_frequency=frequency))
    made, parts = Controller(robot, [task], limits=None), only(**compensation)
    plant = ImperfectPlant(
        IntegratedPlant(RigidBodyPlant(changed(robot, [Inertias(heavy)])), Rk4(h)),
        [SensorDelay(delays[1])],
        [EffortDelay(delays[0])],
    )
    x = simulate(
        made, [1.0], duration=0.6, control_period=h, log_period=h, plant=plant,
        compensation=parts, check_rate=False,
    ).q[:, 0]  # fmt: skip
    action = parts.integral_action
    Ki = ZERO if action is None else action.gains(made.tasks)["posture"]
    Kp, Kv, *_ = made.feedback("posture")
    loop = LinearLoop(Kp, Kv, Ki, h, *delays, parts, 1.0 / heavy)
    other = LinearLoop(1.1 * Kp, Kv, Ki, h, *delays, parts, 1.0 / heavy)
    check_that_it_is_the_loop(x, loop, other)


@pytest.mark.parametrize("lag", [0.004, 0.03])
@pytest.mark.parametrize("observer", [None, MomentumObserver(10.0, order=2)])
def test_a_lag_of_the_drives_is_in_the_linear_loop(
    lag: float, observer: MomentumObserver | None, tmp_path: Path
) -> None:
    """Against a drive that holds the mean of each period; x differs within one.

    Under the mean x(t) moves as if it acted from the period's start: second order in h.
    """
    robot, h = carriage(tmp_path), 0.002
    task = JointPosture(np.zeros(1), gains=Gains(natural_frequency=12.0))
    made, parts = (
        Controller(robot, [task], limits=None),
        only(momentum_observer=observer),
    )
    plant = ImperfectPlant(
        IntegratedPlant(RigidBodyPlant(robot), Rk4(h)), [], [EffortLag(lag)]
    )
    log = simulate(
        made, [1.0], duration=0.6, control_period=h, log_period=h, plant=plant,
        compensation=parts, check_rate=False,
    )  # fmt: skip
    Kp, Kv, *_ = made.feedback("posture")
    loop = LinearLoop(Kp, Kv, ZERO, h, 0, 0, parts, lag=lag)
    A = loop.transition()
    z = np.zeros(len(A))
    z[0], z[3] = 1.0, -float(Kp[0, 0])  # the drive begins at the first effort
    for k in range(1, len(log)):
        z = A @ z
        assert z[0] == pytest.approx(log.q[k, 0], abs=2e-3), k


@pytest.mark.slow
def test_integral_action_unstable_for_a_heavier_robot_is_reported() -> None:
    """Without gravity the arm agrees: 10 % off the prediction it decays or grows."""
    robot = Robot.load("panda", gravity=[0.0, 0.0, 0.0])
    task = JointPosture(Q0, gains=Gains(natural_frequency=20.0))
    made = Controller(robot, [task], limits=None)
    for observer in (None, MomentumObserver(20.0)):
        strong = Compensation(
            integral_action=IntegralAction(12.0), momentum_observer=observer
        )
        (found,) = check_rate(made, Q0, 1e-3, strong)
        assert found.path == ("compensation", "integral_action")
        assert not found.unstable
        reported = re.fullmatch(
            r"if the robot is (.*) times as heavy at task 'posture' .* factor of 5: .*"
            r"Ki of at most (.*) times this, or a (faster )?momentum .*",
            found.message,
        )
        assert reported is not None
        assert (reported[3] is None) is (observer is None)
        times, scale = float(reported[1]), float(reported[2])
        if observer is None:
            assert times == pytest.approx(40.0 / 12.0, rel=0.02)  # Kv Kp/Ki
        for factor, grows in ((0.9 * times, False), (1.1 * times, True)):
            log = simulate(
                made, Q0 + 1e-4, duration=2.0, control_period=1e-3, log_period=0.01,
                integrator=Rk4(1e-3), compensation=strong, check_rate=False,
                plant=RigidBodyPlant(changed(robot, [Inertias(factor)])),
            )  # fmt: skip
            error = np.abs(log["task.posture.error"]).max(axis=1)
            assert bool(error[130:].max() > error[60:130].max()) is grows
        weaker = IntegralAction(12.0 * scale)
        mild = Compensation(integral_action=weaker, momentum_observer=observer)
        assert check_rate(made, Q0, 1e-3, mild) == []


# ------------------------------------------------------------------------- the robot

PANDA = Robot.load("panda")
Q0 = np.array([0.0, -0.5, 0.1, -2.0, 0.2, 1.6, 0.7])
TARGET = Q0 + 1e-3


def holding(
    frequency: float = 50.0, gain: float = 100.0, stiffness: float = 1.0, **more: Any
) -> Controller:
    position = PANDA.state(0.0, Q0, np.zeros(7)).position("panda_tcp") + 1e-4
    gains = Gains(natural_frequency=frequency)
    hand = FramePosition(
        "panda_tcp", Hold(position), gains=gains, largest_error="none", name="hand"
    )
    field = stiffness * TargetPosture(TARGET)
    return Controller(
        PANDA, [hand], field, null_space_gain=gain, **({"limits": None} | more)
    )


@pytest.mark.parametrize(
    ("gains", "limit", "delay"),
    [
        (lambda x: {"gain": x}, 2.0 - 1e-3, 0),
        (lambda x: {"frequency": x}, 0.42616, 1),
        (lambda x: {"gain": x, "stiffness": x}, 1.0, 0),
    ],
    ids=["K_N", "ω0, one period late", "K_N and a stiff field"],
)
def test_the_robot_grows_just_above_and_dies_just_below(
    gains: Any, limit: float, delay: int
) -> None:
    """Stable 3 % below the limit, unstable 3 % above."""
    for side in (-1.0, 1.0):
        made = holding(**gains((1.0 + 0.03 * side) * limit / H))
        engine = IntegratedPlant(RigidBodyPlant(PANDA), Rk4(H))
        plant = ImperfectPlant(engine, [], [EffortDelay(delay)])
        try:
            log = held(made, Q0, duration=0.3, plant=plant, check_rate=False)
            speed = np.linalg.norm(log.v, axis=1)
            growth = speed[-100:].max() / speed[:100].max()
        except hsp.errors.SimulationError:
            growth = np.inf
        assert growth < 0.5 if side < 0.0 else growth > 2.0
        found = check_rate(made, Q0, H, effort_delay=delay, strict=False)
        assert any(finding.unstable for finding in found) is (side > 0.0)


@pytest.mark.parametrize(
    ("how", "path", "message"),
    [
        (
            {"gain": 2500.0},
            ("null_space", "gain"),
            "... K_N ... 2.5 ... 200 1/s ... 8e-05 s ... 1990 1/s ... 0.000799 s",
        ),
        (
            {"frequency": 1500.0},
            ("tasks", "hand", "gains"),
            "... ω0 of task 'hand' ... 1.5 ... 0.000666 s",
        ),
        (
            {"gain": 1100.0, "stiffness": 1100.0},
            ("null_space", "gain"),
            "... K_N ... 1.1 ... stiffness 1100 1/s ... 0.818",
        ),
    ],
)
def test_an_unstable_rate_is_reported_with_stable_values(
    how: dict[str, float], path: tuple[str, ...], message: str
) -> None:
    (finding,) = [
        f for f in check_rate(holding(**how), Q0, H, strict=False) if f.unstable
    ]
    assert finding.path == path
    assert finding.radius > 1.0
    assert re.search(wording(message), finding.message), finding.message
    with pytest.raises(hsp.errors.UnstableRateError, match="unstable at this rate"):
        check_rate(holding(**how), Q0, H)


@pytest.mark.parametrize(
    ("make", "wrong", "delay", "advice"),
    [
        (
            lambda x: Compensation(momentum_observer=MomentumObserver(x)),
            *(3000.0, 1, r"momentum_observer\.bandwidth of at most ([\d.]+) 1/s"),
        ),
        (
            lambda x: Compensation(velocity_filter=VelocityFilter(x, 2)),
            *(5.0, 0, r"velocity_filter\.cutoff of at least ([\d.]+) Hz"),
        ),
    ],
)
def test_the_advice_on_a_compensator_works(
    make: Any, wrong: float, delay: int, advice: str
) -> None:
    made = holding(frequency=40.0, gain=20.0)
    found = check_rate(made, Q0, H, make(wrong), effort_delay=delay, strict=False)
    reported = [re.search(advice, each.message) for each in found if each.unstable]
    numbers = [float(match[1]) for match in reported if match]
    best = min(numbers) if "most" in advice else max(numbers)
    check_rate(made, Q0, H, make(best), effort_delay=delay)


@pytest.mark.parametrize("which", ["effort_delay", "sensor_delay"])
def test_an_excessive_delay_is_reported_with_the_tolerated_one(
    which: str,
) -> None:
    """For ω0 = 20: the phase margin over the crossover, less half a period's hold."""
    robot = Robot.load("panda")
    hand = FramePosition("panda_tcp", gains=Gains(natural_frequency=20.0))
    law = Controller(robot, [hand], Rest(), start=robot.home())

    def check(periods: int) -> list[Any]:
        delays = {"effort_delay": 0, "sensor_delay": 0, which: periods}
        return check_rate(law, robot.home(), H, **delays, strict=False)

    kp, kv = 400.0, 40.0
    crossover = np.sqrt(0.5 * (kv**2 + np.sqrt(kv**4 + 4.0 * kp**2)))
    margin = np.arctan(crossover * kv / kp) / crossover
    most = int(margin / H - 0.5)
    for late in (45, 300, 100_000):
        (found,) = (each for each in check(late) if "tasks" in each.path)
        assert found.unstable, late
        assert f"at most {most}" in found.message, late
    assert not any(each.unstable for each in check(most))
    assert any(each.unstable for each in check(most + 1))


def test_rows_that_do_not_depend_on_one_another_are_as_many_loops() -> None:
    rng = np.random.default_rng(0)
    kp, kv = np.diag(rng.uniform(50.0, 2e5, 4)), np.diag(rng.uniform(5.0, 900.0, 4))
    loop = LinearLoop(kp, kv, 0.0 * kp, H, 3, 2)
    together = np.abs(np.linalg.eigvals(loop.transition())).max()
    assert loop.radius() == pytest.approx(together, rel=1e-9)


def test_a_field_s_slope_is_taken_in_the_null_space_and_the_metric() -> None:
    """TargetPosture has the Hessian 1; over M it is the slope of -M⁻¹∇f."""
    state = PANDA.state(0.0, Q0, np.zeros(7))
    K, A = null_space_rates(holding(stiffness=3.0), state)
    np.testing.assert_allclose(K, 100.0 * np.eye(4), atol=1e-9)
    np.testing.assert_allclose(A, 3.0 * np.eye(4), atol=1e-7)
    K, A = null_space_rates(holding(stiffness=3.0, metric=MassMatrixMetric()), state)
    np.testing.assert_allclose(K, 100.0 * np.eye(4), atol=1e-9)
    M = state.mass_matrix
    J = state.frame("panda_tcp").jacobian[:3]
    # 1e-3 rad from the field's minimum: 3 Zᵀ M⁻¹ Z', in coordinates in which M = I.
    L = np.linalg.cholesky(M)
    Z = np.linalg.svd(np.linalg.solve(L, J.T).T)[2][3:].T
    slope = 3.0 * Z.T @ np.linalg.inv(L) @ np.linalg.inv(L).T @ Z
    got, wanted = np.linalg.eigvalsh(A), np.linalg.eigvalsh(slope)
    np.testing.assert_allclose(got, wanted, rtol=0.05)
    for low, high in pairwise(got):
        assert 0.0 < low < high
    for field in (Rest(), Uncontrolled()):
        hand = FramePosition(
            "panda_tcp", Hold([0.4, 0.0, 0.5]), gains=Gains(natural_frequency=10.0)
        )
        K, A = null_space_rates(Controller(PANDA, [hand], field, limits=None), state)
        assert np.allclose(A, 0.0)
        assert len(K) == (4 if field.controls else 0)


# ---------------------------------------------------------------------- configuration


def config(**sections: Any) -> dict[str, Any]:
    return {
        "robot": {"name": "panda"},
        "tasks": {
            "hand": {
                "type": "frame_position",
                "frame": "panda_tcp",
                "trajectory": {"type": "hold"},
            }
        },
        "simulation": {"duration": 0.02, "control_period": H},
        **sections,
    }


LATE = {"type": "rigid_body", "sensors": {"delay": 1}}


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        (
            {"compensation": {"start_up_ramp": {}}, "simulation": {"duration": 1}},
            "... compensation ... simulation.control_period",
        ),
        ({"null_space": {"gain": 2500}}, "... null_space.gain: unstable ... 2.5"),
        (  # without a delay up to 2000
            {"plant": LATE, "null_space": {"gain": 1100}},
            "... null_space.gain: unstable ... 1 period of delay",
        ),
        (
            {"compensation": {"velocity_filter": {"cutoff": 600, "order": 2}}},
            "... compensation.velocity_filter: ... 600 Hz ... 500 Hz",
        ),
    ],
)
def test_mistakes_are_reported_with_their_place(
    sections: dict[str, Any], message: str
) -> None:
    with pytest.raises(hsp.HspControlError, match=wording(message)):
        load_experiment(config(**sections))


def test_the_command_line_suggests_close_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "close.yaml"
    file.write_text(yaml.safe_dump(config(null_space={"gain": 500})))
    for command in (["check", str(file)], ["run", str(file), "--out", str(tmp_path)]):
        assert main(command) == 0
        output = capsys.readouterr().err
        assert re.search(wording("...hsp: null_space.gain: ... 0.5 ... 0.2"), output)
    assert main(["check", str(file), "--set", "null_space.gain=2500"]) == 2
    assert "unstable at this rate" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("gains", "delay", "message"),
    [
        (
            {"gain": 5000.0},
            0,
            r"^null_space_gain: unstable at this rate: .* most 200 ",
        ),
        (
            {"frequency": 500.0},
            1,
            r"^tasks\.hand\.gains: .*, 1 period of delay .* 100 ",
        ),
    ],
)
def test_a_simulation_has_the_refusals_of_a_run(
    gains: dict[str, float], delay: int, message: str
) -> None:
    """With the plant's delays; a run with the advised gains is stable."""
    how: dict[str, Any] = {"duration": 0.01, "integrator": Rk4(0.1 * H)}
    if delay:
        engine = IntegratedPlant(RigidBodyPlant(PANDA), Rk4(H))
        how["plant"] = ImperfectPlant(engine, [SensorDelay(0)], [EffortDelay(delay)])
    with pytest.raises(hsp.errors.UnstableRateError, match=message):
        simulate(holding(**gains), Q0, control_period=H, **how)
    if not delay:  # no effort is held
        simulate(holding(**gains), Q0, **how)
    (name,) = gains
    mended = {name: 100.0 if delay else 200.0}
    simulate(holding(**mended), Q0, control_period=H, **how)


def test_an_excessive_delay_is_named_with_the_tolerated_one() -> None:
    robot = Robot.load("panda")
    task = JointPosture(Q0, gains=Gains(natural_frequency=40.0))
    made = Controller(robot, [task], limits=None)
    with pytest.raises(UnstableRateError) as caught:
        check_rate(made, Q0, H, Compensation(), effort_delay=30)
    reported = re.search(
        r"a delay of the efforts of at most (\d+) period", str(caught.value)
    )
    assert reported is not None, caught.value
    most = int(reported[1])
    check_rate(made, Q0, H, Compensation(), effort_delay=most)
    with pytest.raises(UnstableRateError):
        check_rate(made, Q0, H, Compensation(), effort_delay=most + 1)
