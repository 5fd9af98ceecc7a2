"""A plan: every run of a sweep, as plain data, and what makes two sweeps the same."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import HspControlError
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.simulation.recorder import versions
from hsp_control.sweeps.factor import Factor

_TRIALS = 20  # a sweep of which that many runs cannot be built is a mistake


@dataclass(frozen=True)
class Plan:
    """Every run of a sweep.

    Attributes:
        name: Of the configuration: a bundled name or a path, whose folder is where
            relative paths in it begin.
        data: The configuration, plain data.
        factors: What is varied.
        design: See `hsp_control.sweeps.design.Design`.
        samples: How many runs were asked for; None for a grid.
        seed: Of the design.
        points: Each run's values, in the order of the factors.
    """

    name: str
    data: dict[str, Any]
    factors: tuple[Factor, ...]
    design: str
    samples: int | None
    seed: int
    points: Sequence[tuple[Any, ...]]

    def __len__(self) -> int:
        return len(self.points)

    def task(self, run: int) -> str:
        """Return all that a worker needs for a run, as a JSON text."""
        # Its paths begin where its file is, and a worker may stand anywhere.
        name = str(Path(self.name).resolve())
        parts = {"name": name, "data": self.data, "changes": self.changes(run)}
        return json.dumps(parts)

    def changes(self, run: int) -> list[dict[str, Any]]:
        """Return where a run's values go, for `insert`."""
        return [
            {"keys": list(factor.keys), "value": value, "origin": factor.origin}
            for factor, value in zip(self.factors, self.points[run], strict=True)
        ]

    def first_run(self) -> int:
        """Return the first run that can be built.

        Single runs may be refused, and are then rows that say why. Where none of the
        first can be built, the sweep itself is wrong.

        Raises:
            HspControlError: What refused the first run, if its successors fail too.
        """
        refusal: HspControlError | None = None
        for run in range(min(len(self), _TRIALS)):
            try:
                self.experiment(run)
            except HspControlError as error:
                refusal = refusal or error
            else:
                return run
        assert refusal is not None
        raise refusal

    def experiment(self, run: int) -> Experiment:
        """Return a run's objects.

        Raises:
            HspControlError: If its configuration is refused.
        """
        return build(document(self.task(run)))

    def identity(self, experiment: Experiment) -> dict[str, Any]:
        """Return what two sweeps must share for one to continue the other.

        The model itself is in it, for a URDF may change under its name; so are the
        versions that numbers depend on.
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
        return dict(json.loads(json.dumps(identity)))  # as files give it back


def document(task: str) -> Document:
    """Return the configuration of a task: the plan's with the run's values in it.

    Raises:
        ConfigError: If a key path leads nowhere.
    """
    parts = json.loads(task)
    found = Document(parts["data"], {}, parts["name"])
    insert(found, parts["changes"])
    return found


def insert(base: Document, changes: Iterable[dict[str, Any]]) -> None:
    """Put a run's values into a configuration.

    Raises:
        ConfigError: If a key path leads nowhere.
    """
    for change in changes:
        base.assign(change["keys"], change["value"], change["origin"])
