"""The model in force: payloads, and gravity, as changes make them.

The inertia of a payload adds to that of the body that carries it, in part while it is
taken up or put down: M, N, their rates and the law are those of the model of the time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.control.evolution import Evolution
from hsp_control.engine import Dynamics
from hsp_control.engine.plans import TIME, PartCall, PartCalls, planned
from hsp_control.robot import Robot


class CarriedBody(NamedTuple):
    """A body that is fixed to a joint, in the axes of the joint."""

    joint: int
    mass: float  # [kg]
    center: tuple[float, ...]  # of mass, 3 numbers [m]
    inertia: tuple[float, ...]  # about it, row by row, 9 numbers [kg·m²]


@dataclass(frozen=True)
class PlannedPayload:
    """A payload, and the times at which it is carried."""

    frame: str
    body: CarriedBody
    share: Evolution[float]  # 1 while it is carried, 0 while it is not


class ModelInForce:
    """Present payloads and gravity in a state's dynamics, and in those that follow."""

    def __init__(self, robot: Robot, dynamics: Sequence[Dynamics]) -> None:
        self._payloads: Sequence[PlannedPayload] = ()
        self._shares = np.zeros((3, 0))  # of each payload, with two derivatives
        self._gravity = Evolution(np.array(robot.model.gravity.linear))
        self._own = self._gravity.initial
        # from the controller's: a plant may have another one
        self._change = np.zeros(3)
        self._dynamics = [*dynamics]
        self._constant = False
        self._bind()

    def follow(self, dynamics: Dynamics | None) -> None:
        """Let other dynamics have the same model, instead of the previous ones."""
        self._dynamics[1:] = [] if dynamics is None else [dynamics]
        self._bind()
        self._write()

    def plan(
        self, payloads: Sequence[PlannedPayload], gravity: Evolution[Array], t: float
    ) -> None:
        """Follow other changes from now on; t is the present time [s]."""
        self._gravity = gravity
        if [*map(id, payloads)] != [*map(id, self._payloads)]:
            self._payloads = payloads
            self._bind()
        self._constant = False
        self.write(t)
        shares = all(each.share.constant for each in payloads)
        self._constant = shares and gravity.constant

    def write(self, t: float) -> None:
        """Set the model to that of a time [s]."""
        if self._constant:  # and written
            return
        for k, each in enumerate(self._payloads):
            self._shares[:, k] = each.share.with_rates(t)
        self._change[:] = self._gravity.at(t) - self._own
        self._write()

    @property
    def calls(self) -> PartCalls:
        """The call that sets the model to that of a time, while it changes."""
        return [] if self._constant else [PartCall(self.write, t=TIME)]

    def _bind(self) -> None:
        bodies, count = [each.body for each in self._payloads], len(self._payloads)
        if self._shares.shape[1] != count:
            self._shares = np.zeros((3, count))
        carried = {
            "joints": np.array([each.joint for each in bodies], dtype=np.int64),
            "masses": np.array([each.mass for each in bodies]),
            "centers": _rows([each.center for each in bodies], 3),
            "inertias": _rows([each.inertia for each in bodies], 9),
            "shares": self._shares[0],
            "rates": self._shares[1],
            "accelerations": self._shares[2],
        }
        calls = []
        for each in self._dynamics:
            calls.append(PartCall(engine.Carry, dynamics=each, **carried))
            calls.append(
                PartCall(engine.ChangeGravity, dynamics=each, change=self._change)
            )
        self._write = planned(calls).call()


def _rows(rows: Sequence[Sequence[float]], size: int) -> Array:
    return np.array(rows, dtype=float).reshape(len(rows), size)
