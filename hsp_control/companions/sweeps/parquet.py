"""Read and write named columns and their metadata as one Parquet file."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.exceptions import SweepError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.sweeps.journal import journal_of

_KEY = b"hsp_control"


def require_parquet() -> None:
    """Check that Parquet files can be written, before hours of computation."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise SweepError(
            "the file of a sweep needs pyarrow: pip install 'hsp_control[sweeps]'"
        ) from None


def write_parquet(
    path: Path, columns: Mapping[str, NDArray[Any]], meta: dict[str, Any]
) -> Path:
    """Write columns and metadata; to a temporary file first, which is then renamed."""
    require_parquet()
    import pyarrow as pa
    import pyarrow.parquet as pq

    # from_pandas: NaN (a metric that a run does not have) becomes null.
    arrays = {
        name: pa.array(column, from_pandas=True) for name, column in columns.items()
    }
    table = pa.table(arrays).replace_schema_metadata({_KEY: json.dumps(meta).encode()})
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            pq.write_table(table, file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        with suppress(OSError):  # its folder may not exist
            part.unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise SweepError(f"{path}: cannot write the sweep: {reason}") from error
    return path


def read_parquet(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return columns and metadata."""
    require_parquet()
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        check_ends(path)
        with path.open("rb") as file:
            table = pq.read_table(file)
    except FileNotFoundError:
        if journal_of(path).is_file():
            raise SweepError(
                f"{path}: does not exist yet, only its journal: the sweep is running "
                "or was killed; the same command resumes it"
            ) from None
        near = [file.name for file in path.parent.glob("*.parquet")]
        raise SweepError(
            f"{path}: no such file{did_you_mean(path.name, near)}"
        ) from None
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise SweepError(f"{path}: not a complete Parquet file: {reason}") from error
    described = (table.schema.metadata or {}).get(_KEY)
    if described is None:
        raise SweepError(f"{path}: a Parquet file, but not a sweep")
    return {name: _column(table[name]) for name in table.column_names}, dict(
        json.loads(described)
    )


def _column(values: Any) -> NDArray[Any]:
    array = values.to_numpy()
    if array.dtype != object or not len(array):
        return np.asarray(array)
    filled = [np.nan if value is None else value for value in array]
    return np.array(filled, dtype=object)
