"""A plan: every run of a sweep as plain data, and the identity of the sweep."""

import hashlib
import json
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeAlias

from hsp_control.common.errors import HspControlError
from hsp_control.companions.sweeps.factor import Factor
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.robot import Robot
from hsp_control.simulation.log_writer import versions

Changes: TypeAlias = "Sequence[tuple[Sequence[str], Any, str]]"

_TRIALS = (
    20  # number of runs that cannot be built after which the sweep itself is wrong
)


@dataclass(frozen=True)
class SweepPlan:
    """Every run of a sweep.

    Attributes:
        base: The configuration, without the varied parameters.
        factors: The varied parameters.
        design: See `hsp_control.companions.sweeps.design.Design`.
        samples: The requested number of runs; None for a grid.
        seed: Seed of the design.
        points: The runs' values, in the order of the factors.
    """

    base: Document
    factors: tuple[Factor, ...]
    design: str
    samples: int | None
    seed: int
    points: Sequence[tuple[Any, ...]]

    def __len__(self) -> int:
        return len(self.points)

    def changes(self, run: int) -> Changes:
        """Return the key paths and values of a run, and their place, for `changed`."""
        return [
            (factor.keys, value, factor.origin)
            for factor, value in zip(self.factors, self.points[run], strict=True)
        ]

    def document(self, run: int) -> Document:
        """Return the configuration of a run."""
        return changed(self.base, self.changes(run))

    def first_run(self) -> tuple[int, Experiment]:
        """Return the first run that can be built, and its objects.

        A single run that cannot be built becomes a row with the reason. If none of the
        first runs can be built, the sweep itself is wrong.
        """
        first_error: HspControlError | None = None
        for run in range(min(len(self), _TRIALS)):
            try:
                return run, build(self.document(run))
            except HspControlError as error:
                first_error = first_error or error
        assert first_error is not None
        raise first_error

    @property
    def varies_robot(self) -> bool:
        """Whether the runs have different robots."""
        return any(factor.keys[0] == "robot" for factor in self.factors)

    def identity(self, robot: Robot) -> dict[str, Any]:
        """Return the data that must be equal for one sweep to continue another.

        They include the model, because a URDF may change under its name, and the
        versions of packages that the numbers depend on.
        """
        identity = {
            "configuration": self.base.to_dict(),
            "factors": [factor.description() for factor in self.factors],
            "design": self.design,
            "samples": self.samples,
            "seed": self.seed,
            "model": fingerprint(robot),
            "versions": versions(),
        }
        return dict(json.loads(json.dumps(identity)))  # as read from files


def changed(base: Document, changes: Changes) -> Document:
    """Return a configuration with other values at some key paths."""
    found = deepcopy(base)
    for keys, value, origin in changes:
        found.assign(list(keys), value, origin)
    return found


def fingerprint(robot: Robot) -> str:
    """Return a text that identifies a model."""
    return hashlib.sha256(robot.model.saveToString().encode()).hexdigest()
