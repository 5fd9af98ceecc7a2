"""Drives: they turn the commanded effort into the applied one."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from math import exp
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.declaration import within
from hsp_control.declaration.by_type import ByType
from hsp_control.declaration.quantities import NonNegative, Periods, Share, Weights
from hsp_control.robot import Robot
from hsp_control.simulation.plants.plant import Imperfection, in_order

Driving: TypeAlias = Callable[[Array], tuple[Array, float]]
"""Effort from the drive before, shape (nv,) ↦ the effort that acts, and how long after
the start of the period it begins to [s]; called once per period."""


class Drive(Imperfection, family="drives", error=SimulationError):
    """One imperfection of the actuation; several make a chain.

    A subclass declares its parameters as fields (see `Part`) and implements `begin`.
    Stages: `DroppedPeriods` 10, `EffortDelay` 20, `Jitter` 30, `EffortLag` 35,
    `EffortNoise` 40, `Saturation` 50; see `Imperfection`.
    """

    @property
    def lag(self) -> float:
        """The time constant with which it follows [s], for the rate check."""
        return 0.0

    @abstractmethod
    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return the drive in one run: a function with its own memory.

        Args:
            robot: The simulated robot.
            random: The random numbers of this drive in this run.

        Raises:
            SimulationError: If a field does not fit the robot.
        """


Drives = Annotated[Sequence[Drive], ByType(Drive), AfterValidator(in_order)]
"""A chain: a sequence in Python, a mapping by type in YAML; stored by stage."""


class DroppedPeriods(Drive, type="dropped"):
    """Efforts are lost at random, and the drive keeps the last one that arrived."""

    stage: ClassVar[float] = 10.0
    strength: ClassVar[str] = "probability"

    probability: Share
    """Probability that an effort is lost, independent of the others [-]; the first is
    never lost."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a function that keeps the last effort; see `Drive.begin`."""
        last: Array | None = None

        def drive(tau: Array) -> tuple[Array, float]:
            nonlocal last
            lost = random.random() < self.probability
            if last is None or not lost:
                last = tau.copy()
            return last, 0.0

        return drive


class EffortDelay(Drive, type="delay"):
    """The effort commanded some periods ago; at first the first effort."""

    stage: ClassVar[float] = 20.0
    strength: ClassVar[str] = "periods"

    periods: Periods
    """Delay of the efforts [control periods]."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a queue of efforts, empty at first; see `Drive.begin`."""
        queue: deque[Array] = deque()

        def drive(tau: Array) -> tuple[Array, float]:
            while len(queue) <= self.periods:
                queue.append(tau.copy())
            return queue.popleft(), 0.0

        return drive


class EffortLag(Drive, type="lag"):
    """A drive of first order, τ f' = effort - f; over a period its mean acts."""

    stage: ClassVar[float] = 35.0
    strength: ClassVar[str] = "time_constant"

    time_constant: NonNegative
    """Time constant τ [s]."""

    @property
    def lag(self) -> float:
        """The time constant; see `Drive.lag`."""
        return float(self.time_constant)

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return the lag, which begins at the first effort; see `Drive.begin`."""
        return RunningLag(self.lag)


class RunningLag:
    """A drive of first order in one run; it receives the length of each period."""

    def __init__(self, time_constant: float) -> None:
        self._time_constant = time_constant
        self.period = 0.0  # [s]
        self._effort: Array | None = None

    def __call__(self, tau: Array) -> tuple[Array, float]:
        """Return the mean over the period; see `Driving`."""
        before = tau if self._effort is None else self._effort
        left = exp(-self.period / self._time_constant)
        self._effort = tau + left * (before - tau)
        share = self._time_constant / self.period * (1.0 - left)
        return tau + share * (before - tau), 0.0


class EffortNoise(Drive, type="noise"):
    """Gaussian white noise on the effort, constant during a period."""

    stage: ClassVar[float] = 40.0
    strength: ClassVar[str] = "std"

    std: Weights
    """Standard deviation of effort noise [N·m or N], one number or nv."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a function that adds noise to the effort; see `Drive.begin`."""
        with within("std"):
            std = robot.per_dof(self.std)
        return lambda tau: (tau + std * random.standard_normal(std.shape), 0.0)


class Jitter(Drive, type="jitter"):
    """Every effort takes effect after a uniformly random delay."""

    stage: ClassVar[float] = 30.0
    strength: ClassVar[str] = "longest"

    longest: NonNegative
    """Maximum additional delay [s], drawn for every period; an effort takes effect at
    the end of its period at the latest."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a function that draws a delay for every effort; see `Drive.begin`."""
        return lambda tau: (tau, float(random.uniform(0.0, self.longest)))


class Saturation(Drive, type="saturation"):
    """Joint efforts are clipped at their limits."""

    stage: ClassVar[float] = 50.0

    limit: Literal["model"] | Weights = "model"
    """Maximum effort [N·m or N], one number or nv, 0 for no limit; ``model`` takes it
    from the URDF, where that has one."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a function that clips the effort; see `Drive.begin`."""
        with within("limit"):
            limit = self._limit(robot)
        limit = np.where(limit > 0.0, limit, np.inf)
        return lambda tau: (np.clip(tau, -limit, limit), 0.0)

    def _limit(self, robot: Robot) -> Array:
        """Return the limits, shape (nv,), with 0 for none."""
        if not isinstance(self.limit, str):
            return robot.per_dof(self.limit)
        own = np.asarray(robot.model.upperEffortLimit, dtype=float)
        given = robot.is_single_dof() & (own > 0.0) & np.isfinite(own)
        if not given.any():
            raise SimulationError(
                f"the URDF of {robot.name} gives no effort limits; state them"
            )
        return np.where(given, own, 0.0)
