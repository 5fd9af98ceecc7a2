"""A sweep: its parameters and metrics as named columns, and its file."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.exceptions import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.sweeps.parquet import read_parquet, write_parquet
from hsp_control.companions.sweeps.plan import SweepPlan, document
from hsp_control.companions.sweeps.row import SweepRow
from hsp_control.simulation.measures import Measure

FORMAT = "hsp_control sweep 1"

Column = NDArray[Any]


class Sweep:
    """Runs of one configuration: columns of equal length, one row per run.

    Columns are ``run``, ``status``, ``message``, ``wall_time``, the parameters by their
    key paths, and the metrics. A metric that a run does not have is NaN.

    Attributes:
        columns: Arrays by name; text columns have NumPy's type ``object``.
        meta: JSON data: ``format``; ``identity`` (configuration, factors, design, seed,
            versions); ``name``; ``runs``, the number of planned runs; ``parameters``:
            for each name its keys and whether its values are JSON; ``metrics``: for
            each name its unit and meaning.
    """

    def __init__(self, columns: Mapping[str, Column], meta: dict[str, Any]) -> None:
        """Create it from columns and metadata."""
        self.columns = dict(columns)
        self.meta = meta

    @classmethod
    def collect(
        cls,
        plan: SweepPlan,
        identity: dict[str, Any],
        rows: Iterable[SweepRow],
        described: Mapping[str, Measure],
    ) -> Self:
        """Return the sweep of a plan's finished runs, in the plan's order."""
        ordered = sorted(rows, key=lambda row: row.run)
        columns: dict[str, Column] = {
            "run": np.array([row.run for row in ordered], dtype=np.int64),
            "status": _texts([row.status for row in ordered]),
            "message": _texts([row.message for row in ordered]),
            "wall_time": np.array([row.wall_time for row in ordered]),
        }
        parameters = {}
        for k, factor in enumerate(plan.factors):
            # From all values of the plan, so that partial sweeps have the same type.
            column = _parameter([point[k] for point in plan.points])
            encoded = column is None
            if column is None:
                column = _texts([json.dumps(point[k]) for point in plan.points])
            columns[factor.name] = column[columns["run"]]
            parameters[factor.name] = {"keys": list(factor.keys), "json": encoded}
        # In the order of runs; the order in which they finish varies.
        measured = [name for row in ordered for name in row.metrics]
        names = list(dict.fromkeys([*measured, *described]))
        for name in names:
            columns[name] = np.array([row.metrics.get(name, np.nan) for row in ordered])
        meta = {
            "format": FORMAT,
            "name": plan.name,
            "runs": len(plan),
            "parameters": parameters,
            "metrics": {
                name: {"unit": described[name].unit, "meaning": described[name].meaning}
                for name in names
            },
            "identity": identity,
        }
        return cls(columns, meta)

    def __getitem__(self, name: str) -> Column:
        try:
            return self.columns[name]
        except KeyError:
            raise SweepError(
                f"the sweep has no column {name!r}{did_you_mean(name, self.columns)} "
                f"(it has {listing(self.columns, 40)})"
            ) from None

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.columns["run"])

    def __repr__(self) -> str:
        over = ", ".join(self.parameters)
        return f"Sweep({len(self)} of {self.meta['runs']} runs over {over})"

    @property
    def parameters(self) -> list[str]:
        """The names of the varied parameters."""
        return list(self.meta["parameters"])

    @property
    def metrics(self) -> list[str]:
        """The names of the metrics."""
        return list(self.meta["metrics"])

    @property
    def complete(self) -> bool:
        """Whether every planned run has a row."""
        return len(self) == int(self.meta["runs"])

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Whether each run was completed, shape (N,)."""
        return np.asarray(self.columns["status"] == "completed")

    def configuration(self, run: int) -> dict[str, Any]:
        """Return the complete configuration of a run, to repeat or inspect it.

        For example ``hsp.load_experiment(sweep.configuration(17)).run()``.

        Raises:
            SweepError: If the sweep has no such run.
        """
        rows = np.flatnonzero(self.columns["run"] == run)
        if not len(rows):
            raise SweepError(f"the sweep has no run {run} (it has {len(self)} runs)")
        changes = []
        for name, parameter in self.meta["parameters"].items():
            value = self.columns[name][rows[0]]
            value = value.item() if isinstance(value, np.generic) else value
            changes.append(
                {
                    "keys": parameter["keys"],
                    "value": json.loads(value) if parameter["json"] else value,
                    "origin": name,
                }
            )
        data = self.meta["identity"]["configuration"]
        task = {"name": self.meta["name"], "data": data, "changes": changes}
        return document(json.dumps(task)).to_dict()

    def rows(self) -> list[SweepRow]:
        """Return the runs as rows, without the parameters, which are in the plan."""
        names = self.metrics
        return [
            SweepRow(
                int(self["run"][i]),
                str(self["status"][i]),
                str(self["message"][i]),
                {n: float(self[n][i]) for n in names if not np.isnan(self[n][i])},
                float(self["wall_time"][i]),
            )
            for i in range(len(self))
        ]

    def save(self, path: str | Path) -> Path:
        """Write the sweep to one Parquet file.

        Raises:
            SweepError: If it cannot be written, or pyarrow is not installed.
        """
        return write_parquet(Path(path), self.columns, self.meta)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a sweep's file.

        Raises:
            SweepError: If the file is missing or not a sweep, or pyarrow is missing.
        """
        path = Path(path)
        columns, meta = read_parquet(path)
        if meta.get("format") != FORMAT:
            raise SweepError(
                f"{path}: its format is {meta.get('format')!r}; this version reads "
                f"{FORMAT!r}"
            )
        return cls(columns, meta)


def _texts(values: list[str]) -> Column:
    return np.array(values, dtype=object)


def _parameter(values: list[Any]) -> Column | None:
    """Return values as a column of one type; None if they have different types."""
    kinds = {type(value) for value in values}
    if kinds == {str}:
        return _texts(values)
    if kinds == {bool}:
        return np.array(values)
    if kinds == {int} and all(abs(value) < 2**63 for value in values):
        return np.array(values, dtype=np.int64)
    if kinds and kinds <= {int, float} and all(abs(value) < 2**53 for value in values):
        return np.array(values, dtype=np.float64)
    return None
