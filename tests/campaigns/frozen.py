"""Frozen controllers against Python's: the same bits at any state.

For every bundled configuration that can be frozen: the states of a run of ten seconds,
and random states around its start, slow ones near it and fast ones far away. Both make
a step at each state; status and effort must be equal. Then the same with all
compensators that can be frozen with the configuration.
"""

import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from frozen_library import LIB, Opened
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    CompensationError,
    FreezeError,
    HspControlError,
)
from hsp_control.common.resources import bundled_configs
from hsp_control.control.compensation import Compensation

PERIOD = 1e-3
"""Control period of configurations with a continuous law [s]."""
DURATION = 10.0
"""Duration of a run [s]."""
DRAWN = 100_000
"""Random states per configuration."""
BATCH = 1000
"""Steps per run of random states."""
SPREADS = (0.05, 0.05), (0.5, 0.5), (1.5, 3.0)
"""Largest distances from the start [rad or m], and speeds [rad/s or m/s]."""
BARE = Compensation(momentum_observer=None)
"""No compensators."""
COMPENSATORS: dict[str, Any] = {
    "velocity_filter": hsp.compensation.VelocityFilter(80.0),
    # with a clip, so that a compliant hand still yields
    "momentum_observer": hsp.compensation.MomentumObserver(30.0, clip=5.0),
    "integral_action": hsp.compensation.IntegralAction(1.0, limit=1.0),
    "start_up_ramp": hsp.compensation.StartUpRamp(0.3),
}
"""All compensators that can be frozen."""


@dataclass
class Tally:
    """The outcome of one configuration.

    Attributes:
        refused: Why it cannot be frozen; empty if it can.
        compensators: The names of active compensators.
        run: Steps of the run.
        drawn: Steps at random states.
        different: Steps whose status or effort differs in a bit.
        status: Steps by their status.
        raised: Steps that both refuse.
    """

    refused: str = ""
    compensators: tuple[str, ...] = ()
    run: int = 0
    drawn: int = 0
    different: int = 0
    status: Counter[int] = field(default_factory=Counter)
    raised: int = 0


class Pair:
    """A controller in Python, possibly with compensators, and its frozen copy."""

    def __init__(
        self,
        controller: hsp.Controller,
        compensation: Compensation,
        file: Path,
        period: float,
        tally: Tally,
    ) -> None:
        self._declared, self._compensation = controller, compensation
        self._period, self._tally = period, tally
        self._opened = Opened(file)
        self.begin()

    def begin(self) -> None:
        """Begin a run."""
        self._own = hsp.compensation.CompensatedController(
            self._declared.preview(), self._compensation
        )
        LIB.hsp_restart(self._opened.handle)
        self._raised = 0

    def step(self, t: float, q: Array, v: Array) -> None:
        """Make a step of both and compare."""
        status = self._opened.step(t, q, v)
        try:
            tau = self._own.effort(t, q, v, self._period)
        except HspControlError:
            self._tally.raised += 1
            self._tally.different += status >= 0
            # After many refused steps the library stops the robot; Python continues.
            self._raised += 1
            return
        self._raised = 0
        expected = self._own.output.status
        same = status == expected and np.array_equal(self._opened.tau, tau)
        self._tally.different += not same
        self._tally.status[status] += 1

    @property
    def lost(self) -> bool:
        """Whether both must restart after too many consecutive refusals."""
        return self._raised == 5


def compensated(experiment: hsp.Experiment, period: float) -> Compensation:
    """Return all compensators that can be frozen with a configuration."""
    found = BARE
    for name, each in COMPENSATORS.items():
        more = replace(found, **{name: each})
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "frozen.hsp"
            try:
                hsp.freeze(
                    experiment.controller, file, compensation=more, period=period
                )
            except (FreezeError, CompensationError):
                continue
        found = more
    return found


def compared(
    name: str, drawn: int, duration: float, seed: int, *, compensators: bool = False
) -> Iterator[Tally]:
    """Yield the outcome of a configuration so far.

    Args:
        name: The configuration's name.
        drawn: Number of random states.
        duration: Duration of its run [s].
        seed: Seed of the random states.
        compensators: Whether all that can be frozen are active; if none can be, nothing
        is compared.
    """
    tally = Tally()
    period = hsp.load_experiment(name).scenario.simulation.control_period or PERIOD
    at = f"simulation.duration={duration}", f"simulation.log_period={period}"
    experiment = hsp.load_experiment(name, *at)
    compensation = compensated(experiment, period) if compensators else BARE
    tally.compensators = compensation.names
    if compensators and not compensation.names:
        tally.refused = "no compensator can be frozen with it"
        yield tally
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frozen.hsp"
        given = {"compensation": compensation, "period": period}
        try:
            hsp.freeze(experiment.controller, file, start=experiment.q0, **given)
        except FreezeError as error:
            tally.refused = str(error)
            yield tally
            return
        pair = Pair(experiment.controller, compensation, file, period, tally)
        run = experiment.run()
        for t, q, v in zip(run.t, run.q, run.v, strict=True):
            pair.step(float(t), q, v)
            tally.run += 1
        yield tally
        rng, robot = np.random.default_rng(seed), experiment.robot
        for batch in range(-(-drawn // BATCH)):
            away, fast = SPREADS[batch % len(SPREADS)]
            pair.begin()
            pair.step(0.0, experiment.q0, np.zeros(robot.nv))
            for k in range(1, BATCH + 1):
                moved = rng.uniform(-away, away, robot.nv)
                q = robot.integrate(experiment.q0, moved)
                pair.step(k * period, q, rng.normal(0.0, fast, robot.nv))
                tally.drawn += 1
                if pair.lost:
                    pair.begin()
                    pair.step(k * period, experiment.q0, np.zeros(robot.nv))
            yield tally


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Compare all bundled configurations, without compensators and with them."""
    good, drawn = True, max(1, round(share * DRAWN))
    given = drawn, DURATION * min(share, 1.0), seed
    for name in bundled_configs():
        for kind in ("", "-compensated"):
            bar = progress.add_task(f"frozen {name}{kind}", total=drawn)
            for tally in compared(name, *given, compensators=bool(kind)):
                progress.update(bar, completed=tally.drawn)
                counts = vars(tally) | {"wanted": DRAWN, "seed": seed}
                keep(f"frozen-{name.replace('/', '_')}{kind}", counts)
            good &= not tally.different
    return good
