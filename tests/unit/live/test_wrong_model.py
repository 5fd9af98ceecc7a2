"""Where nothing is measured, joints are expected under their load, too.

Masses are wrong by 20 %: without the load of before, the model expects an arm at rest
to fall or to rise, and the safe stop brakes a motion that there is not.
"""

from functools import partial

import numpy as np
import pytest
from lies import LIES, Sensors
from live_rigs import Rig
from loaded_robots import load
from places import further

import hsp_control as hsp
from hsp_control.live import (
    LiveSettings,
    Measurement,
    SimulatedRobot,
    StopSettings,
    run_loop,
)
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant
from hsp_control.simulation.plants.model_changes import Inertias, changed

KNOWN = 1.0
"""Time after which the fault begins [s]: 3 % of the load were not known yet 0.2 s
before."""
SETTINGS = LiveSettings(
    effort_rate=1000.0, stop=StopSettings(hold=0.02, longest_damping=0.3)
)
# The robot's own stop is late: the loop's must suffice.
PATIENT = LiveSettings(velocity_margin=99.0)


class Blind(Rig):
    """A robot at rest whose masses differ, and which is not measured any more."""

    def __init__(
        self,
        arm: str,
        share: float,
        *,
        silent: bool,
        period: float = 0.002,
        begin: float = KNOWN,
    ) -> None:
        known = load(arm)
        true = RigidBodyPlant(changed(known, [Inertias(share)]))
        plant = IntegratedPlant(true, SemiImplicitEuler(period))
        q, v = known.home(), np.zeros(known.nv)
        super().__init__(SimulatedRobot(plant, q, v, period, settings=PATIENT))
        self.silent, self.fastest, self.good = silent, 0.0, round(begin / period)
        every = np.ones(known.nv, dtype=bool)
        both = every, self.good, np.random.default_rng(0), period
        self.jump = partial(Sensors(*both), lie=LIES["both: +1 and +0.1"])

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        if self.reads < self.good:
            return self.jump(found)
        self.fastest = max(self.fastest, float(np.abs(found.v).max()))
        return None if self.silent else self.jump(found)


def at_rest(arm: str, metric: hsp.metrics.Metric | None = None) -> hsp.Controller:
    own = load(arm)
    tip = own.state(0.0, own.home(), np.zeros(own.nv)).position(own.hand.frame)
    task = hsp.FramePosition(own.hand.frame, tip)
    return hsp.Controller(own, [task], hsp.TargetPosture(own.home()), metric=metric)


@pytest.mark.parametrize(
    ("arm", "share", "silent"),
    [
        *(("xarm7", 0.8, False), ("panda", 1.2, True)),
        *further(
            *(("xarm7", 1.2, False), ("xarm7", 0.8, True), ("panda", 0.8, False)),
            *(("iiwa14", 0.8, False), ("iiwa14", 1.2, True), ("ur5", 1.2, False)),
            *(("panda", 1.2, False), ("xarm7", 1.2, True), ("ur5", 0.8, True)),
        ),
    ],
)
def test_an_arm_of_other_masses_that_is_not_measured_stays_at_rest(
    arm: str, share: float, silent: bool
) -> None:
    """All joints are lost at once: they jump, or there is no state any more."""
    robot = Blind(arm, share, silent=silent)
    report = run_loop(at_rest(arm), robot, duration=2.0, settings=SETTINGS)
    assert report.ended == "fault"
    assert ("no new state" if silent else "jumps by") in report.reason
    assert robot.fastest < 0.3


@pytest.mark.parametrize("begin", [1.0, 1.004, *further(1.006, 1.011, 1.02)])
def test_the_effort_that_is_held_in_a_silence_does_not_drive_an_arm(
    begin: float,
) -> None:
    """Over W = M(q) the effort of a wrist of 3e-4 kg m² changes by 0.02 N·m in a step.

    That of the last moment alone would give up to 0.54 rad/s in 10 ms. The mean of
    10 ms gives 0.11 rad/s, whenever the silence begins.
    """
    robot = Blind("xarm7", 1.2, silent=True, period=0.001, begin=begin)
    law = at_rest("xarm7", hsp.metrics.MassMatrixMetric())
    report = run_loop(law, robot, duration=2.0, settings=SETTINGS)
    assert "no new state" in report.reason
    assert robot.fastest < 0.3
