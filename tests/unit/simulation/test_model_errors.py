"""Errors of the model that a loop tolerates: reported, and simulated."""

import numpy as np
import pytest
from compensators import ALONE
from places import further
from wrong_arms import ARMS, H, WrongArm, holding, posture

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.compensation import Compensation
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.model_errors import ModelErrors, Moved, lines, model_errors
from hsp_control.simulation.plants import (
    ImperfectPlant,
    IntegratedPlant,
    RigidBodyPlant,
)
from hsp_control.simulation.plants.drives import EffortDelay
from hsp_control.simulation.plants.model_changes import MotorInertia, changed


def borne(
    name: str, compensation: Compensation, motor_inertia: float | None = None
) -> tuple[ModelErrors, hsp.Controller, Array]:
    made, q = holding(WrongArm(name, 0, motor_inertia=motor_inertia))
    found = model_errors(made, q, H, compensation)
    assert found is not None
    return found, made, q


def growth(
    made: hsp.Controller, q: Array, plant: hsp.plants.Plant, until: float
) -> float:
    """Return the growth of a small motion in the second half of a run."""
    start = made.robot.integrate(q, 1e-4 * np.random.default_rng(0).normal(size=len(q)))
    log = hsp.simulate(
        made, start, duration=until, control_period=H, plant=plant, check_rate=False
    )
    error = np.linalg.norm(log["task.hand.error"], axis=1)
    part = len(error) // 4
    return float(error[-part:].max() / error[part : 2 * part].max())


@pytest.mark.parametrize("name", ["panda", *further("iiwa14", "xarm7")])
def test_reported_rotors_are_tolerated_and_larger_ones_are_not(name: str) -> None:
    found, made, q = borne(name, Compensation())
    for times, grows in ((0.6, False), (1.6, True)):
        rotors = changed(made.robot, [MotorInertia(times * found.rotor)])
        assert (growth(made, q, RigidBodyPlant(rotors), 3.0) > 1.0) is grows
    # With rotors in the model, larger ones are tolerated.
    more, *_ = borne(name, Compensation(), motor_inertia=0.1)
    assert more.rotor > 5.0 * min(found.rotor, 0.1)


@pytest.mark.parametrize("name", ["panda", *further("ur5")])
def test_a_reported_delay_is_tolerated_and_a_longer_one_is_not(name: str) -> None:
    found, made, q = borne(name, Compensation())
    periods = round(found.delay / H)
    for late, grows in ((periods - 3, False), (periods + 3, True)):
        engine = IntegratedPlant(RigidBodyPlant(made.robot), Rk4(H))
        plant = ImperfectPlant(engine, [], [EffortDelay(late)])
        assert (growth(made, q, plant, 2.0) > 1.0) is grows, late


@pytest.mark.parametrize("rotors", [0.05, *further(0.02)])
def test_rotors_that_the_drives_hide_cost_delay(rotors: float) -> None:
    """Too large a modelled rotor raises the loop gain: less delay is tolerated."""
    made, q = holding(WrongArm("panda", 0, motor_inertia=rotors))
    found = model_errors(made, q, H, Compensation())
    assert found is not None
    assert found.hidden is not None
    assert found.hidden < 0.5 * found.delay
    assert "rotors hidden" in lines(found)
    bare = hsp.Robot.load("panda", motor_inertia=0.0)
    periods = round(found.hidden / H)
    for late, grows in ((periods, False), (periods + 3, True)):
        engine = IntegratedPlant(RigidBodyPlant(bare), Rk4(H))
        plant = ImperfectPlant(engine, [], [EffortDelay(late)])
        assert (growth(made, q, plant, 2.0) > 1.0) is grows, late
    plain, *_ = borne("panda", Compensation())
    assert plain.hidden is None


class Pushed(RigidBodyPlant):
    """The model under an effort that is not commanded."""

    push: Array

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        return super().acceleration(t, q, v, tau + self.push)


@pytest.mark.parametrize("joint", [3, *further(0, 5)])
def test_an_unknown_effort_moves_the_hand_as_reported(joint: int) -> None:
    """0.01 N·m moves it by a hundredth of the value reported for 1 N·m."""
    small = 0.01
    for compensation in (*further(ALONE), Compensation()):
        found, made, q = borne("panda", compensation)
        plant = Pushed(made.robot)
        plant.push = small * np.eye(7)[joint]
        log = hsp.simulate(
            made, q, duration=1.5, control_period=H, log_period=H, plant=plant,
            integrator=Rk4(H), compensation=compensation, check_rate=False,
        )  # fmt: skip
        for each, rows in zip(found.moved, (slice(0, 3), slice(3, 6)), strict=True):
            away = np.linalg.norm(log["task.hand.error"][:, rows], axis=1)
            peak = small * each.peak[joint]
            if compensation == ALONE:  # 1.5 s are 15 time constants
                resting = small * each.resting[joint]
                assert away[-1] == pytest.approx(resting, rel=0.03, abs=1e-7)
            else:
                assert away.max() == pytest.approx(peak, rel=0.03, abs=1e-7)
                assert away[-1] < 0.02 * peak


@pytest.mark.parametrize("name", ARMS)
def test_by_default_no_mode_grows_and_the_check_is_fast(name: str) -> None:
    """A loop without an observer is reported as such, also in the text."""
    found, made, q = borne(name, Compensation())
    assert (found.growing, found.growth) == (0, 0.0)
    assert lines(found)["masses ±20 %"] == "no growing mode"
    assert found.delay >= 0.005
    assert found.lag >= 0.005
    alone, *_ = borne(name, ALONE)
    reported = lines(alone)["masses ±20 %"]
    assert reported.startswith(f"{alone.growing} of 8 grow") is (alone.growing > 0)
    if name == "iiwa14":
        assert alone.growing > 0
    light = "rotors" in lines(found)
    assert light is (found.rotor < 0.05) is (name in ("iiwa14", "xarm7"))
    assert (alone.moved[0].resting == pytest.approx(found.moved[0].resting)) is True
    assert (found.moved[0].peak < 0.5 * found.moved[0].resting + 1e-6).all()
    assert posture(made.robot, name) == pytest.approx(q)


def test_it_has_no_answer_where_the_loop_is_not_that_of_an_arm() -> None:
    walker = hsp.Robot.load("talos")
    hand = hsp.FramePosition(walker.end_effector)
    floating = hsp.Controller(walker, [hand], base="driven")
    assert model_errors(floating, walker.home(), H, Compensation()) is None


def test_the_table_has_millimetres_degrees_and_the_joint_that_moves_most() -> None:
    resting, peak = np.array([0.02, 0.001]), np.array([0.003, 0.004])
    moved = [
        Moved("hand", part, unit, resting, peak)
        for part, unit in (("position", "m"), ("orientation", "rad"))
    ]
    found = lines(
        ModelErrors(
            tuple(moved), ("first", "second"), 0.0125, 0.03, 0, 8, 0.0, np.inf, 0.004
        )
    )
    assert found["1 N·m unknown, hand position"] == (
        "20, 1 mm by joint without an observer, at most 4 mm (second) as it is"
    )
    assert found["1 N·m unknown, hand orientation"] == (
        "1.1, 0.057 ° by joint without an observer, at most 0.23 ° (second) as it is"
    )
    assert found["tolerates"] == "a delay of 12.5 ms, or a lag of 30 ms"
    assert "at most 4 ms of delay is tolerated" in found["rotors hidden"]
