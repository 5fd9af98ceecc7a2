"""A plan: every run of a sweep as plain data, and the identity of the sweep."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import HspControlError
from hsp_control.companions.sweeps.factor import Factor
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.simulation.log_writer import versions

_TRIALS = 20  # if so many runs cannot be built, the sweep itself is wrong


@dataclass(frozen=True)
class SweepPlan:
    """Every run of a sweep.

    Attributes:
        name: Path of the configuration; relative paths in it begin at its folder.
        data: The configuration, plain data.
        factors: The varied parameters.
        design: See `hsp_control.companions.sweeps.design.Design`.
        samples: The requested number of runs; None for a grid.
        seed: Seed of the design.
        points: Each run's values, in the order of the factors.
        time_limit: The longest computation of a run [s]; None: any.
    """

    name: str
    data: dict[str, Any]
    factors: tuple[Factor, ...]
    design: str
    samples: int | None
    seed: int
    points: Sequence[tuple[Any, ...]]
    time_limit: float | None = None

    def __len__(self) -> int:
        return len(self.points)

    def task(self, run: int) -> str:
        """Return all data that a worker needs for a run, as a JSON text."""
        # Absolute, because a worker may have another working folder.
        name = str(Path(self.name).resolve())
        parts = {
            "name": name,
            "data": self.data,
            "changes": self.changes(run),
            "time_limit": self.time_limit,
        }
        return json.dumps(parts)

    def changes(self, run: int) -> list[dict[str, Any]]:
        """Return the values of a run and their key paths, for `insert`."""
        return [
            {"keys": list(factor.keys), "value": value, "origin": factor.origin}
            for factor, value in zip(self.factors, self.points[run], strict=True)
        ]

    def first_run(self) -> int:
        """Return the first run that can be built.

        A single run that cannot be built becomes a row with the reason. If none of the
        first runs can be built, the sweep itself is wrong.
        """
        first_error: HspControlError | None = None
        for run in range(min(len(self), _TRIALS)):
            try:
                self.experiment(run)
            except HspControlError as error:
                first_error = first_error or error
            else:
                return run
        assert first_error is not None
        raise first_error

    def experiment(self, run: int) -> Experiment:
        """Return a run's objects."""
        return build(document(self.task(run)))

    def identity(self, experiment: Experiment) -> dict[str, Any]:
        """Return the data that must be equal for one sweep to continue another.

        They include the model, because a URDF may change under its name, and the
        versions of packages that the numbers depend on.
        """
        model = experiment.robot.model.saveToString()
        identity = {
            "configuration": self.data,
            "factors": [factor.description() for factor in self.factors],
            "design": self.design,
            "samples": self.samples,
            "seed": self.seed,
            "model": hashlib.sha256(model.encode()).hexdigest(),
            "versions": versions(),
        }
        return dict(json.loads(json.dumps(identity)))  # as read from files


def document(task: str) -> Document:
    """Return the configuration of a task: the plan's, with the run's values."""
    parts = json.loads(task)
    found = Document(parts["data"], {}, parts["name"])
    insert(found, parts["changes"])
    return found


def insert(base: Document, changes: Iterable[dict[str, Any]]) -> None:
    """Set a run's values in a configuration."""
    for change in changes:
        base.assign(change["keys"], change["value"], change["origin"])
