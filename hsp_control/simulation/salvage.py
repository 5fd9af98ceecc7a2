"""Reads the complete entries of a truncated log (a full disk, a lost connection).

The directory of a zip archive is at its end, so a truncated archive has none. But each
entry begins with a header of its own. The entries are read in order until one is
incomplete. The entries that every log needs are written first.
"""

import io
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.simulation.log_file import MAX_COLUMNS, MAX_SIZE, read_array

_HEADER = struct.Struct("<4s5H3I2H")
_SIGNATURE = b"PK\x03\x04"
_ZIP64 = 1
_UNKNOWN = 0xFFFFFFFF
_STREAMED = 0x08
"""Flag of an entry whose size follows its content; our logs have no such entry."""


class Entry(NamedTuple):
    """The local header of an entry.

    Attributes:
        name: Its name, without ``.npy``.
        method: Its compression: 0 none, 8 deflate.
        checksum: CRC-32 of its content.
        packed: Compressed size in the file [bytes].
        size: Size of its content [bytes].
    """

    name: str
    method: int
    checksum: int
    packed: int
    size: int


def read_complete_entries(path: Path) -> tuple[dict[str, Array], str]:
    """Return the complete arrays by name, and the name of the first incomplete one.

    That name is empty if the archive ends between two entries.

    Raises:
        OSError: If the file cannot be read.
    """
    arrays: dict[str, Array] = {}
    left = MAX_SIZE
    with path.open("rb") as file:
        while len(arrays) < MAX_COLUMNS:
            entry = _next_entry(file)
            if entry is None:
                return arrays, ""
            try:
                array = _read_content(file, entry, left)
            except (ValueError, EOFError, zlib.error):
                return arrays, entry.name
            arrays[entry.name] = array
            left -= entry.size
    return arrays, ""


def _next_entry(file: IO[bytes]) -> Entry | None:
    """Read a local header; return None if there is none, or only a part of one."""
    header = file.read(_HEADER.size)
    if len(header) < _HEADER.size:
        return None
    signature, _, flags, method, _, _, checksum, *sizes = _HEADER.unpack(header)
    packed, size, name_length, extra_length = sizes
    name, extra = file.read(name_length), file.read(extra_length)
    if signature != _SIGNATURE or flags & _STREAMED or len(extra) < extra_length:
        return None
    if packed == _UNKNOWN or size == _UNKNOWN:
        kind, length = struct.unpack_from("<2H", extra) if len(extra) >= 4 else (0, 0)
        if kind != _ZIP64 or length < 16 or len(extra) < 20:
            return None
        size, packed = struct.unpack_from("<2Q", extra, 4)
    text = name.decode("utf-8", "replace").removesuffix(".npy")
    return Entry(text, method, checksum, packed, size)


def _read_content(file: IO[bytes], entry: Entry, max_size: int) -> Array:
    if not 0 < entry.size <= max_size or entry.packed > MAX_SIZE:
        raise ValueError("empty, or too large")
    packed = file.read(entry.packed)
    if len(packed) < entry.packed:
        raise EOFError
    if entry.method == zipfile.ZIP_DEFLATED:
        packed = zlib.decompressobj(-zlib.MAX_WBITS).decompress(packed, entry.size)
    elif entry.method != zipfile.ZIP_STORED:
        raise ValueError("unknown compression")
    if len(packed) != entry.size or zlib.crc32(packed) != entry.checksum:
        raise ValueError("wrong size or checksum")
    return read_array(io.BytesIO(packed), entry.size, entry.name)
