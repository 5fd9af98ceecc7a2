"""Refused runs, and the part of an interrupted run that is kept."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from closed_loops import EXACT, load, planar_controller, planar_start
from wording import wording

from hsp_control import Controller, RobotState, Rollout, simulate
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    ConfigurationError,
    NonFiniteError,
    ShapeError,
    SimulationError,
)
from hsp_control.null_space.fields import FunctionField
from hsp_control.robot.integrators import Rk4, SemiImplicitEuler

# --- refusals -----------------------------------------------------------------------


NO_MULTIPLE = "is not a whole multiple of"
TIMES: list[tuple[dict[str, float], str]] = [
    ({"duration": 0.0}, "duration is 0.0 s ... positive"),
    ({"duration": np.nan}, "duration is nan s ... positive"),
    ({"duration": np.inf}, "duration is inf s ... positive"),
    ({"duration": 0.1, "log_period": 0.0}, "log_period is 0.0 s ... positive"),
    ({"duration": 0.105}, "duration = 0.105 s ... log_period = 0.01 s"),
    ({"duration": 0.005}, "duration = 0.005 s ... log_period = 0.01 s"),
    ({"duration": 0.1, "control_period": 0.003},
     "control_period: ... 0.003 s ... log_period ... 0.009"),
    ({"duration": 2.0, "control_period": 1},
     "control_period: 1 s ... milliseconds, write 0.001 ... log_period ... 1"),
    ({"duration": 1e300, "log_period": 1e-300},
     "duration = 1e+300 s ... inf ... log_period = 1e-300 s"),
    ({"duration": 0.1, "control_period": -0.001}, "control_period is -0.001 s"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "message"), TIMES)
def test_times_that_do_not_fit(options: dict[str, float], message: str) -> None:
    with pytest.raises(SimulationError, match=wording(message)) as caught:
        simulate(planar_controller(), planar_start(), **options)  # type: ignore
    assert caught.value.rollout is None


@pytest.mark.parametrize(("q0", "v0", "kind", "message"), [
    ([0.0] * 3, None, ShapeError, r"^configuration q has shape \(3,\); planar3r "),
    ([0.0] * 6, None, ConfigurationError, r"^q\[0:2\] = .* of norm 0; needs norm"),
    ([np.nan] * 6, None, NonFiniteError, r"^configuration q\[0\] is nan"),
    (None, [0.0] * 6, ShapeError, r"^velocity v0 has shape \(6,\); planar3r needs"),
    (None, [0.0, np.inf, 0.0], NonFiniteError, r"^velocity v0\[1\] is inf"),
    (None, "fast", ShapeError, r"^velocity v0 is 'fast' \(str\); needs 3 numbers$"),
])  # fmt: skip
def test_starts_that_are_none(q0: Any, v0: Any, kind: Any, message: str) -> None:
    with pytest.raises(kind, match=message):
        simulate(
            planar_controller(), planar_start() if q0 is None else q0, v0, duration=0.1
        )


# --- kept rows -----------------------------------------------------------------------


def simulate_until_interrupted(*arguments: Any, **options: Any) -> Rollout:
    """Simulate; a Ctrl-C that propagates fails the test, not the session."""
    try:
        return simulate(*arguments, **options)
    except KeyboardInterrupt:
        pytest.fail("the Ctrl-C got through")


@pytest.mark.parametrize("row", [0, 1, 17, 50])
def test_ctrl_c_keeps_computed_rows(row: int, planar_run: Rollout) -> None:
    """Interrupted at row k: k + 1 rows, the same as the whole run's."""

    def interrupt(fraction: float) -> None:
        if round(fraction * 50) == row:
            raise KeyboardInterrupt

    run = simulate_until_interrupted(
        planar_controller(),
        planar_start(),
        duration=0.5,
        integrator=EXACT,
        on_progress=interrupt,
    )
    assert run.status == "interrupted"
    assert run.meta["message"] == "stopped by the user"
    assert len(run) == row + 1
    for name, column in run.columns.items():
        np.testing.assert_array_equal(column, planar_run[name][: row + 1], err_msg=name)


def test_ctrl_c_before_the_first_row() -> None:
    robot = load("planar3r", gravity=False)
    built = []

    def pressed(state: RobotState) -> Array:
        if built:
            raise KeyboardInterrupt
        return np.zeros(3)

    field = FunctionField(pressed)
    controller = Controller(robot, planar_controller().tasks, field)
    built.append(True)
    run = simulate_until_interrupted(controller, planar_start(), duration=0.5)
    assert run.status == "interrupted"
    assert len(run) == 0
    assert repr(run) == "Rollout(planar3r: tip; 0 rows, empty, interrupted)"


@pytest.mark.parametrize(
    ("options", "least"),
    [
        # K_N h = 20: the loop diverges; 2 is the limit (docs/law.md, Sampled control).
        ({"control_period": 0.01}, 2),
        ({"control_period": 0.01, "integrator": SemiImplicitEuler(0.01)}, 2),
        ({"integrator": SemiImplicitEuler(0.01)}, 2),
        ({"integrator": Rk4(0.01)}, 1),
    ],
)
def test_divergence_keeps_the_rollout(
    options: dict[str, Any], least: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(9)
    with pytest.raises(SimulationError, match=r"^the simulation stopped: ") as caught:
        simulate(
            planar_controller(2000.0),
            planar_start(),
            rng.normal(size=3),
            duration=1.0,
            check_rate=False,
            **options,
        )
    run = caught.value.rollout
    assert isinstance(run, Rollout)
    assert run.status == "diverged"
    assert run.meta["message"] in str(caught.value)
    assert least <= len(run) < 101
    assert all(np.isfinite(run[name]).all() for name in ("t", "q", "v", "tau"))
    loaded = Rollout.load(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(loaded.v, run.v)
