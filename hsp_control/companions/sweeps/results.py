"""A sweep: its parameters and metrics as named columns."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.errors import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.sweeps.plan import changed
from hsp_control.config.document import Document

if TYPE_CHECKING:
    import pyarrow as pa

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
    def of_table(cls, table: "pa.Table", meta: dict[str, Any]) -> Self:
        """Return the sweep of a table of rows."""
        return cls({name: _column(table[name]) for name in table.column_names}, meta)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read the folder of a sweep, also of one that is running or was stopped.

        Raises:
            SweepError: If there is none, or pyarrow is missing.
        """
        from hsp_control.companions.sweeps.row_files import read_rows

        return cls.of_table(*read_rows(Path(path)))

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
        """Whether the runs were completed, shape (N,)."""
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
            plain = json.loads(value) if parameter["json"] else value
            changes.append((parameter["keys"], plain, name))
        base = Document(self.meta["identity"]["configuration"], {}, self.meta["name"])
        return changed(base, changes).to_dict()


def _column(values: Any) -> Column:
    array = values.to_numpy()
    if array.dtype != object or not len(array):
        return np.asarray(array)
    filled = [np.nan if value is None else value for value in array]
    return np.array(filled, dtype=object)
