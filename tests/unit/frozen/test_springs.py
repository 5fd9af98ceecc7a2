"""The stiffness of a frozen controller changes as on a controller's time line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_library import LIB, OK, TOO_MANY, WRONG_SIZE, WRONG_VALUE, Opened

import hsp_control as hsp

H = 0.001
SOFT, STIFF = [300.0, 400.0, 500.0], [900.0, 1200.0, 600.0]


def pair(impedance: hsp.Impedance, folder: Path) -> tuple[hsp.Controller, Opened]:
    """Return a controller with an impedance task, and the same without Python."""
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", impedance=impedance, name="hand")
    controller = hsp.Controller(
        robot,
        [hand],
        hsp.JointCentering(),
        metric=hsp.metrics.MassMatrixMetric(),
        start=robot.home(),
    )
    opened = Opened(hsp.freeze(controller, folder / "frozen.hsp", period=H))
    return controller.preview(), opened


class Both:
    """Steps both at the same states and compares them."""

    def __init__(self, controller: hsp.Controller, opened: Opened) -> None:
        self.controller, self.opened = controller, opened
        self.q, self.count = controller.robot.home(), 0
        self.step(0.0)  # the target is at the hand

    def step(self, speed: float, away: float = 0.0) -> None:
        """Make a step at a speed [rad/s], so far from home [rad]."""
        t, v = self.count * H, np.full(7, speed)
        output = self.controller.compute(t, self.q + away, v)
        self.controller.applied(output.tau, H)
        assert self.opened.step(t, self.q + away, v) == output.status
        np.testing.assert_array_equal(self.opened.tau, output.tau)
        self.count += 1

    def change(self, impedance: hsp.Impedance, ramp: float, **inputs: Any) -> None:
        """Change the impedance of both, from the last step's time on."""
        t = (self.count - 1) * H
        self.controller.at(t).ramp(ramp).impedance("hand", impedance)
        for name, values in inputs.items():
            assert self.opened.ramp(f"hand.{name}", values, ramp) == OK

    @property
    def stiffness(self) -> np.ndarray:
        """The frozen controller's active stiffness."""
        return self.opened.get("hand.stiffness", 9)


def test_it_waits_where_it_would_add_energy(tmp_path: Path) -> None:
    """Bit for bit: also after the change is forgotten, and with another one."""
    both = Both(*pair(hsp.Impedance(SOFT), tmp_path))
    both.step(0.0, away=0.1)
    both.change(hsp.Impedance(STIFF), 0.02, stiffness=np.diag(STIFF))
    for _ in range(60):
        both.step(0.0, away=0.1)
    assert both.stiffness[0] < 1.01 * SOFT[0]  # it waits
    for _ in range(1200):  # until Python has forgotten the change
        both.step(0.02, away=0.1)
    assert 1.01 * SOFT[0] < both.stiffness[0] < STIFF[0]
    both.change(hsp.Impedance(SOFT), 0.02, stiffness=np.diag(SOFT))
    for _ in range(5):
        both.step(0.3, away=0.05)
    both.change(hsp.Impedance(STIFF), 0.04, stiffness=np.diag(STIFF))
    for _ in range(150):
        both.step(0.5, away=0.02)
    np.testing.assert_allclose(both.stiffness, np.diag(STIFF).ravel(), rtol=1e-2)
    for _ in range(1100):
        both.step(0.0)
    np.testing.assert_allclose(both.stiffness, np.diag(STIFF).ravel(), rtol=1e-12)


def test_settings_are_effective_at_once(tmp_path: Path) -> None:
    both = Both(*pair(hsp.Impedance(SOFT), tmp_path))
    both.step(0.0, away=0.1)
    both.change(hsp.Impedance(STIFF), 0.0, stiffness=np.diag(STIFF))
    for _ in range(10):
        both.step(0.0, away=0.1)
        np.testing.assert_array_equal(both.stiffness, np.diag(STIFF).ravel())


def test_damping_ratio_and_stiffness_change_together(tmp_path: Path) -> None:
    both = Both(*pair(hsp.Impedance(SOFT, damping_ratio=0.7), tmp_path))
    both.step(0.2, away=0.02)
    both.change(hsp.Impedance(SOFT, damping_ratio=1.2), 0.02, damping_ratio=1.2)
    for _ in range(8):
        both.step(0.2, away=0.02)
    new = hsp.Impedance(STIFF, damping_ratio=1.2)
    both.change(new, 0.02, stiffness=np.diag(STIFF))
    for _ in range(300):
        both.step(0.4, away=0.02)
    assert both.opened.get("hand.damping_ratio", 1) == pytest.approx(1.2)


def test_damping_and_stiffness_without_a_ratio(tmp_path: Path) -> None:
    stiff = np.array([[800.0, 100.0, 0.0], [100.0, 500.0, 0.0], [0.0, 0.0, 300.0]])
    both = Both(*pair(hsp.Impedance(SOFT, damping=40.0), tmp_path))
    assert "hand.damping_ratio" not in both.opened.ports
    both.step(0.2, away=0.02)
    both.change(hsp.Impedance(stiff.tolist(), damping=40.0), 0.01, stiffness=stiff)
    for _ in range(5):
        both.step(0.4, away=0.02)
    more = hsp.Impedance(stiff.tolist(), damping=60.0)
    both.change(more, 0.01, damping=60.0 * np.eye(3))
    for _ in range(60):
        both.step(0.4, away=0.02)
    np.testing.assert_array_equal(
        both.opened.get("hand.damping", 9), 60.0 * np.eye(3).ravel()
    )


def test_before_the_first_step_it_is_so_from_the_beginning(tmp_path: Path) -> None:
    controller, opened = pair(hsp.Impedance(SOFT), tmp_path)
    assert opened.ramp("hand.stiffness", np.diag(STIFF), 5.0) == OK
    controller.at(-1.0).ramp(0.0).impedance("hand", hsp.Impedance(STIFF))
    both = Both(controller, opened)
    both.step(0.1, away=0.1)
    np.testing.assert_array_equal(both.stiffness, np.diag(STIFF).ravel())
    assert LIB.hsp_restart(opened.handle) == OK
    fresh, _ = pair(hsp.Impedance(SOFT), tmp_path)
    again = Both(fresh, opened)
    np.testing.assert_array_equal(again.stiffness, np.diag(SOFT).ravel())


@pytest.mark.parametrize(
    "stiffness",
    [
        np.diag([300.0, 300.0, -1.0]),
        np.diag([300.0, np.nan, 300.0]),
        np.array([[300.0, 1.0, 0.0], [0.0, 300.0, 0.0], [0.0, 0.0, 300.0]]),
        np.zeros((3, 3)),  # without stiffness a ratio gives no damping
        1e8 * np.eye(3),  # unstable at this period
        1e300 * np.eye(3),
    ],
)
def test_invalid_stiffness_is_refused(stiffness: Any, tmp_path: Path) -> None:
    both = Both(*pair(hsp.Impedance(SOFT), tmp_path))
    assert both.opened.set("hand.stiffness", stiffness) == WRONG_VALUE
    assert "stiff" in both.opened.error
    assert both.opened.set("hand.damping_ratio", -1.0) == WRONG_VALUE
    assert both.opened.set("hand.damping_ratio", 1e4) == WRONG_VALUE
    assert both.opened.set("hand.stiffness", np.eye(2)) == WRONG_SIZE
    both.step(0.1, away=0.1)  # as if nothing had been


def test_each_stiff_direction_is_damped(tmp_path: Path) -> None:
    """Along a direction without stiffness the hand can be guided, undamped if
    declared."""
    line = [0.0, 0.0, 500.0]
    own = hsp.Impedance(line, damping=[0.0, 0.0, 30.0])
    both = Both(*pair(own, tmp_path))
    assert both.opened.set("hand.stiffness", np.diag([10.0, 0, 500.0])) == WRONG_VALUE
    assert both.opened.set("hand.damping", np.diag([30.0, 0.0, 0.0])) == WRONG_VALUE
    assert both.opened.set("hand.damping", np.diag([5.0, 0.0, 30.0])) == OK
    assert both.opened.set("hand.stiffness", np.diag([10.0, 0, 500.0])) == OK


def test_too_many_at_a_time(tmp_path: Path) -> None:
    both = Both(*pair(hsp.Impedance(SOFT), tmp_path))
    for _ in range(8):
        assert both.opened.ramp("hand.stiffness", np.diag(STIFF), 0.1) == OK
    assert both.opened.ramp("hand.damping_ratio", 1.0, 0.1) == TOO_MANY
