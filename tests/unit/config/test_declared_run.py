"""A run made in Python can be repeated from its log, or the log says why it cannot."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control.common.errors import ConfigError
from hsp_control.live import InProcessRobot, OperatorRequests, SimulatedRobot

ROBOT = hsp.Robot.load("planar3r")
HAND = hsp.FramePosition("tip", axes="xy", blend=0.1)
Q0 = ROBOT.integrate(ROBOT.home(), np.full(3, 0.1))
RUN = {"duration": 0.03, "control_period": 0.001}


def heavier() -> hsp.Robot:
    """Return another robot with the name of a bundled one, made from a model."""
    model = ROBOT.model.copy()
    body = model.inertias[2]
    model.inertias[2] = pin.Inertia(2.0 * body.mass, body.lever, body.inertia)
    return hsp.Robot.from_pinocchio(model, home=ROBOT.home())


def law(robot: hsp.Robot = ROBOT, **changed: Any) -> hsp.Controller:
    field = changed.pop("field", 2.0 * hsp.Manipulability())
    return hsp.Controller(robot, [HAND], field, **changed)


def repeated(log: Path) -> hsp.Rollout:
    return hsp.load_experiment(log).run()


def test_a_simulation_repeats_from_where_and_when_it_began(tmp_path: Path) -> None:
    """Relative values refer to a configuration other than Q0; a change precedes the
    run."""
    made = law(start=ROBOT.home())
    made.at(0.5).gains("tip", hsp.Gains(natural_frequency=3.0))
    run = hsp.simulate(made, Q0, **RUN, start_time=1.0)
    again = repeated(run.save(tmp_path / "run.npz"))
    for name in ("t", "q", "tau"):
        np.testing.assert_array_equal(again[name], run[name])
    elsewhere = hsp.simulate(law(), Q0, **RUN, start_time=1.0)
    assert not np.allclose(elsewhere.tau, run.tau)
    again = hsp.load_experiment(tmp_path / "run.npz", "start.relative_to=null")
    assert not np.allclose(again.run().tau, run.tau)
    with pytest.raises(hsp.HspControlError, match=r"start\.relative_to: .* shape \(2,"):
        hsp.load_experiment(tmp_path / "run.npz", "start.relative_to=[0, 1]")


@pytest.mark.parametrize("given", [
    {}, {"control_period": None}, {"integrator": hsp.integrators.Rk4(0.0005)},
    {"plant": hsp.plants.RigidBodyPlant(ROBOT)},
    {"plant": hsp.plants.RigidBody(motor_inertia=0.01)},
], ids=["alone", "continuous", "integrator", "own model", "other plant"])  # fmt: skip
def test_a_simulation_repeats(given: dict[str, Any], tmp_path: Path) -> None:
    run = hsp.simulate(law(), Q0, **RUN | given)
    again = repeated(run.save(tmp_path / "run.npz"))
    for name in ("q", "tau"):
        np.testing.assert_array_equal(again[name], run[name])


def test_the_run_of_a_model_repeats_and_not_that_of_its_name(tmp_path: Path) -> None:
    other = heavier()
    assert other.name == ROBOT.name
    run = hsp.simulate(law(other), Q0, **RUN)
    again = repeated(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(again.tau, run.tau)
    assert not np.allclose(hsp.simulate(law(), Q0, **RUN).tau, run.tau)


def test_a_live_loop_repeats_as_a_simulation_until_its_stop(tmp_path: Path) -> None:
    plant = hsp.plants.IntegratedPlant(
        hsp.plants.RigidBodyPlant(ROBOT), hsp.integrators.Rk4(0.001)
    )
    robot = SimulatedRobot(plant, Q0, np.zeros(3), 0.001)
    requests, log = OperatorRequests(), tmp_path / "loop.journal"

    killed = tmp_path / "killed.journal"

    def on_period(t: float) -> None:
        if t > 0.05 and not killed.exists():  # the journal of a killed run
            shutil.copy(log, killed)
        if t > 0.1:
            requests.stop()

    hsp.run_loop(
        law(), InProcessRobot(robot), log=log, requests=requests, on_period=on_period,
        clock=lambda: robot.t,
    )  # fmt: skip
    run = hsp.Rollout.load(log)
    for left, duration in ((log, 0.1), (killed, 0.05)):
        again = repeated(left)
        assert again.t[-1] == pytest.approx(duration)
        np.testing.assert_allclose(again.q, run.q[: len(again)], atol=1e-12)


@pytest.mark.parametrize(("made", "given", "why"), [
    ({"field": hsp.FunctionCost(lambda state: state.q[0] ** 2)}, {},
     r"field\.0\.function: YAML cannot express <lambda>: it is Python"),
    ({}, {"plant": hsp.plants.RigidBodyPlant(heavier())},
     "its plant is a RigidBodyPlant that was built in Python; give a PlantPart"),
])  # fmt: skip
def test_an_unrepeatable_run_gives_the_reason(
    made: dict[str, Any], given: dict[str, Any], why: str, tmp_path: Path
) -> None:
    log = hsp.simulate(law(**made), Q0, **RUN | given).save(tmp_path / "run.npz")
    with pytest.raises(ConfigError, match=f"contains no configuration: {why}"):
        hsp.load_experiment(log)
