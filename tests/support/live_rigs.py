"""Robots for the live loop: small, in this process, with faults on demand."""

from collections.abc import Callable

import numpy as np
from loaded_robots import panda

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.live import InProcessRobot, LiveSettings, Measurement, SimulatedRobot
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant

PERIOD = 0.001


def start() -> Array:
    return panda().home().copy()


def gravity(q: Array) -> Array:
    return panda().inverse_dynamics(q, np.zeros(7), np.zeros(7))


def law(
    field: hsp.NullSpaceField | None = None,
    gains: hsp.Gains = hsp.Gains(natural_frequency=10.0),  # noqa: B008 (a value)
    limits: hsp.Limits | None = None,
) -> hsp.Controller:
    """Return a controller that draws a circle and swings the elbow."""
    tip = panda().state(0.0, start(), np.zeros(7)).position("panda_tcp")
    path = hsp.Circle(0.1, 3.0, tip + np.array([0.0, 0.0, 0.1]), normal=[1.0, 0.0, 0.0])
    task = hsp.FramePosition("panda_tcp", path, gains=gains, name="tip")
    q = start()
    q[0] += 0.5
    field = hsp.TargetPosture(q) if field is None else field
    return hsp.Controller(panda(), [task], field, null_space_gain=10.0, limits=limits)


def watched(
    settings: LiveSettings | None = None,
    period: float = PERIOD,
    arm: hsp.Robot | None = None,
) -> SimulatedRobot:
    """Return a simulated arm, by default a Panda, at its home."""
    arm = arm or panda()
    plant = IntegratedPlant(RigidBodyPlant(arm), SemiImplicitEuler(period))
    return SimulatedRobot(
        plant, arm.home().copy(), np.zeros(arm.nv), period, settings=settings
    )


Trick = Callable[[Measurement], Measurement | None]


class Rig(InProcessRobot):
    """A robot whose measurements are modified, by the number of the read.

    Attributes:
        sent: All efforts that it received.
        reads: Number of reads.
    """

    def __init__(
        self,
        robot: SimulatedRobot | None = None,
        tricks: dict[int, Trick] | None = None,
    ) -> None:
        super().__init__(robot or watched())
        self.tricks = tricks or {}
        self.sent: list[Array] = []
        self.reads = 0

    def read(self, timeout: float) -> Measurement | None:  # type: ignore[override]
        found = super().read(timeout)
        self.reads += 1
        assert self.reads < 20_000, "the loop does not end"
        trick = self.tricks.get(self.reads)
        return found if trick is None else trick(found)

    def write(self, effort: Array) -> None:
        super().write(effort)
        self.sent.append(np.array(effort))


def missing(found: Measurement) -> None:
    return None


def nan_velocity(found: Measurement) -> Measurement:
    v = found.v.copy()
    v[2] = np.nan
    return found._replace(v=v)


def always(trick: Trick, begin: int, count: int = 20_000) -> dict[int, Trick]:
    return dict.fromkeys(range(begin, begin + count), trick)
