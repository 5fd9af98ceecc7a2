"""Robots for the live loop: small, in this process, and misbehaving to order."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from hsp_control import (
    Circle,
    Controller,
    FramePosition,
    Gains,
    Limits,
    NullSpaceField,
    Robot,
    TargetPosture,
)
from hsp_control.live import InProcessRobot, LiveSettings, Measurement, SimulatedRobot
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant

Array = NDArray[np.float64]
PERIOD = 0.001


@cache
def panda() -> Robot:
    return Robot.load("panda")


def start() -> Array:
    return panda().home().copy()


def law(
    field: NullSpaceField | None = None,
    gains: Gains = Gains(natural_frequency=10.0),  # noqa: B008 (a value)
    limits: Limits | None = None,
) -> Controller:
    """Return a controller that draws a circle and swings the elbow."""
    tip = panda().state(0.0, start(), np.zeros(7)).position("panda_tcp")
    path = Circle(0.1, 3.0, tip + np.array([0.0, 0.0, 0.1]), normal=[1.0, 0.0, 0.0])
    task = FramePosition("panda_tcp", path, gains=gains, name="tip")
    q = start()
    q[0] += 0.5
    field = TargetPosture(q) if field is None else field
    return Controller(panda(), [task], field, null_space_gain=10.0, limits=limits)


def watched(settings: LiveSettings | None = None) -> SimulatedRobot:
    plant = IntegratedPlant(RigidBodyPlant(panda()), SemiImplicitEuler(PERIOD))
    return SimulatedRobot(plant, start(), np.zeros(7), PERIOD, settings=settings)


Trick = Callable[[Measurement], Measurement | None]


class Rig(InProcessRobot):
    """A robot whose measurements pass through tricks, by the number of the read.

    Attributes:
        sent: All efforts that it was sent.
        reads: How often it was read.
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
