"""Reads and writes the ``.npz`` file of a log; files that are read are not trusted.

NumPy's own reader trusts the sizes that a file declares. Before this reader allocates
memory, it checks that an entry holds plain numbers or text, has the size given in the
archive's directory, and that all entries together are at most `MAX_SIZE`. Nothing is
ever unpickled.
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
"""Most bytes of all columns in memory: an hour at 1 kHz with 70 numbers per row."""
MAX_COLUMNS = 10_000
"""Most entries of a log."""

_KINDS = "fiubU"
"""NumPy kinds that are allowed: numbers, booleans and text."""


def read_arrays(path: Path) -> dict[str, Array]:
    """Return the arrays of an ``.npz`` by name.

    Raises:
        OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error: If the file
            is incomplete, too large, or holds anything else than plain arrays.
    """
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        _check_sizes(entries)
        arrays: dict[str, Array] = {}
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            if name == entry.filename:
                raise ValueError(f"its entry {shortened(name)} is not an array")
            if name in arrays:
                raise ValueError(f"it has two entries {shortened(name)}")
            with archive.open(entry) as stream:
                arrays[name] = read_array(stream, entry.file_size, name)
                if stream.read(1):
                    raise ValueError(
                        f"its entry {shortened(name)} is longer than it declares"
                    )
    return arrays


def read_array(stream: IO[bytes], size: int, name: str) -> Array:
    """Return the array of an ``.npy`` stream that is ``size`` bytes long.

    Raises:
        ValueError: If it is not a plain array of exactly this size.
        EOFError: If the stream ends early.
    """
    version = npy.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = npy.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, fortran, dtype = npy.read_array_header_2_0(stream)
    else:
        raise ValueError(f"its entry {shortened(name)} has an unknown format")
    if dtype.hasobject:
        raise ValueError(
            f"its entry {shortened(name)} is a pickle; pickles are never opened"
        )
    plain = dtype.kind in _KINDS and (dtype.kind == "U" or dtype.itemsize <= 8)
    if not plain or dtype.fields is not None or dtype.subdtype:
        raise ValueError(f"its entry {shortened(name)} is neither numbers nor text")
    content = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or stream.tell() + content != size:
        raise ValueError(f"its entry {shortened(name)}: size contradicts its shape")
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
    """Write arrays as an ``.npz``, in the given order, without pickles."""
    np.savez_compressed(file, allow_pickle=False, **arrays)


def shortened(value: object) -> str:
    """Return a name or a value as one line of at most 60 characters, for a message."""
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
