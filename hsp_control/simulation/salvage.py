"""Read what is whole of a log that was cut: by a full disk, a lost connection.

The directory of a zip archive stands at its end, so that a cut one has none. But each
entry begins with a header of its own; they are read in their order until one is not
whole. What a log cannot do without is written first.
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
"""The flag of an entry whose size stands behind it: no log of ours has one."""


class Entry(NamedTuple):
    """An entry's local header.

    Attributes:
        name: Its name, without ``.npy``.
        method: How it is packed: 0 not at all, 8 deflated.
        checksum: CRC-32 of its content.
        packed: Bytes in the file.
        size: Bytes of its content.
    """

    name: str
    method: int
    checksum: int
    packed: int
    size: int


def read_whole_entries(path: Path) -> tuple[dict[str, Array], str]:
    """Return the arrays that are whole, by name, and the first that is not.

    The name is empty where the archive ends between two of them.

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
                array = _content(file, entry, left)
            except (ValueError, EOFError, zlib.error):
                return arrays, entry.name
            arrays[entry.name] = array
            left -= entry.size
    return arrays, ""


def _next_entry(file: IO[bytes]) -> Entry | None:
    """Read a local header; None where there is none, or half of one."""
    header = file.read(_HEADER.size)
    if len(header) < _HEADER.size:
        return None
    fields = _HEADER.unpack(header)
    signature, _, flags, method, _, _, checksum, packed, size, of_name, of_more = fields
    name, more = file.read(of_name), file.read(of_more)
    if signature != _SIGNATURE or flags & _STREAMED or len(more) < of_more:
        return None
    if packed == _UNKNOWN or size == _UNKNOWN:
        kind, length = struct.unpack_from("<2H", more) if len(more) >= 4 else (0, 0)
        if kind != _ZIP64 or length < 16 or len(more) < 20:
            return None
        size, packed = struct.unpack_from("<2Q", more, 4)
    text = name.decode("utf-8", "replace").removesuffix(".npy")
    return Entry(text, method, checksum, packed, size)


def _content(file: IO[bytes], entry: Entry, most: int) -> Array:
    if not 0 < entry.size <= most or entry.packed > MAX_SIZE:
        raise ValueError("empty, or too large")
    packed = file.read(entry.packed)
    if len(packed) < entry.packed:
        raise EOFError
    if entry.method == zipfile.ZIP_DEFLATED:
        packed = zlib.decompressobj(-zlib.MAX_WBITS).decompress(packed, entry.size)
    elif entry.method != zipfile.ZIP_STORED:
        raise ValueError("packed in another way")
    if len(packed) != entry.size or zlib.crc32(packed) != entry.checksum:
        raise ValueError("not what was written")
    return read_array(io.BytesIO(packed), entry.size, entry.name)
