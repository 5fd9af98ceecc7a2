"""The file of a log: an ``.npz`` that is written whole, and read with suspicion.

NumPy's own reader believes what a file says of its sizes. This one asks for plain
numbers and texts, of the size that stands in the archive's directory, and no more of
them than `MAX_SIZE`, before it reserves any memory. Nothing is ever unpickled.
"""

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from hsp_control.common.arrays import Array

MAX_SIZE = 2_000_000_000
"""Bytes of all columns together, in memory: an hour at 1 kHz with 70 numbers a row."""
MAX_COLUMNS = 10_000
"""Entries of a log."""

_KINDS = "fiubU"
"""Numbers, truth values and text."""


def read_arrays(path: Path) -> dict[str, Array]:
    """Return the arrays of an ``.npz`` by name.

    Raises:
        OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error: If it is not
            whole, too large, or holds something else than plain arrays.
    """
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        _check_sizes(entries)
        arrays: dict[str, Array] = {}
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            if name == entry.filename:
                raise ValueError(f"its entry {shortened(name)} is no array")
            if name in arrays:
                raise ValueError(f"it has two entries {shortened(name)}")
            with archive.open(entry) as stream:
                arrays[name] = read_array(stream, entry.file_size, name)
                if stream.read(1):
                    raise ValueError(
                        f"its entry {shortened(name)} is longer than it says"
                    )
    return arrays


def read_array(stream: IO[bytes], size: int, name: str) -> Array:
    """Return the array of an ``.npy`` stream that is ``size`` bytes long.

    Raises:
        ValueError: If it holds no plain array of just this size.
        EOFError: If the stream ends before.
    """
    version = npy.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = npy.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, fortran, dtype = npy.read_array_header_2_0(stream)
    else:
        raise ValueError(f"its entry {shortened(name)} has a format that is not known")
    if dtype.hasobject:
        raise ValueError(
            f"its entry {shortened(name)} is a pickle, which is never opened"
        )
    plain = dtype.kind in _KINDS and (dtype.kind == "U" or dtype.itemsize <= 8)
    if not plain or dtype.fields is not None or dtype.subdtype:
        raise ValueError(f"its entry {shortened(name)} is neither numbers nor text")
    content = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or stream.tell() + content != size:
        raise ValueError(f"its entry {shortened(name)} has another size than its shape")
    data = bytearray(content)
    read, view = 0, memoryview(data)
    while read < content:
        part = stream.read(min(content - read, 1 << 20))
        if not part:
            raise EOFError(f"its entry {shortened(name)} ends early")
        view[read : read + len(part)] = part
        read += len(part)
    if not content:
        return np.zeros(shape, dtype)
    array = np.frombuffer(data, dtype)
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


def write_arrays(file: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write arrays as an ``.npz``, in their order, without pickles."""
    np.savez_compressed(file, allow_pickle=False, **arrays)


def shortened(value: object) -> str:
    """Return a name or a value for a message, in one short line."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _check_sizes(entries: list[zipfile.ZipInfo]) -> None:
    if len(entries) > MAX_COLUMNS:
        raise ValueError(f"{len(entries)} entries; at most {MAX_COLUMNS}")
    total = sum(entry.file_size for entry in entries)
    if total > MAX_SIZE:
        raise ValueError(
            f"it unpacks to {total / 1e9:.3g} GB; at most {MAX_SIZE / 1e9:.3g} GB"
        )
