"""A log as it should not be: cut, bent, lying about its sizes, full of nonsense."""

import io
import json
import struct
import zipfile
from random import Random
from typing import Any

import numpy as np

from campaigns.mutate_yaml import NUMBERS, TEXTS
from campaigns.texts import TRICKS

Arrays = dict[str, Any]


class Touch:
    """Touches a file where it is unpickled."""

    def __init__(self, canary: str) -> None:
        self.canary = canary

    def __reduce__(self) -> tuple[Any, ...]:
        return (open, (self.canary, "w"))


def mutated(data: bytes, random: Random, canary: str) -> bytes:
    """Return a log with something done to it."""
    trick = random.random()
    if trick < 0.35:
        return random.choice(TRICKS[:4])(data, random)
    if trick < 0.45:
        return _lying(data, random)
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for _ in range(random.choice((1, 1, 2))):
        _change(arrays, random, canary)
    return packed(arrays)


def packed(arrays: Arrays) -> bytes:
    """Return an archive of arrays, pickles among them."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asanyarray(array), allow_pickle=True)
            archive.writestr(f"{name}.npy", content.getvalue())
    return file.getvalue()


def _change(arrays: Arrays, random: Random, canary: str) -> None:
    columns = [name for name in arrays if name != "meta"]
    name = random.choice(columns)
    match random.randrange(14):
        case 0:
            arrays[name] = np.array([Touch(canary)], dtype=object)
        case 1:
            del arrays[name]
        case 2:
            arrays[name] = arrays[name][: random.randrange(len(arrays[name]))]
        case 3:
            arrays[name] = np.asarray(arrays[name]).reshape(-1)
        case 4:
            kind = random.choice(
                ("U9", "i4", "?", "f2", "c16", "M8[s]", "S5", "f16", ">f8")
            )
            arrays[name] = np.zeros(np.shape(arrays[name]), kind)
        case 5:
            bad = random.choice((np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0, 1e-300))
            arrays[name] = np.full(np.shape(arrays[name]), bad)
        case 6:
            array = np.array(arrays[name], dtype=float)
            array.flat[random.randrange(array.size)] = random.choice(
                (np.nan, 1e300, -1.0)
            )
            arrays[name] = array
        case 7:
            arrays[name] = np.asfortranarray(arrays[name])
        case 8:
            arrays[random.choice(("x", "../x", "a/b", "\u202e", "q ", "x" * 300))] = (
                arrays[name]
            )
        case 9:
            arrays[name], other = arrays[random.choice(columns)], arrays[name]
            arrays[random.choice(columns)] = other
        case 10:
            rows = random.choice((0, 1))
            for column in columns:
                if column in arrays:
                    arrays[column] = arrays[column][:rows]
        case _:
            arrays["meta"] = _meta(str(arrays["meta"]), random)


def _meta(text: str, random: Random) -> Any:
    trick = random.random()
    if trick < 0.1:
        return np.array(
            random.choice(TRICKS[:5])(text.encode(), random).decode("utf-8", "replace")
        )
    if trick < 0.15:
        return np.array(
            random.choice(("", "[]", "null", "1", "[" * 100_000, '{"a":' * 100_000))
        )
    meta = json.loads(text)
    for _ in range(random.choice((1, 2))):
        holder: Any = meta
        key: Any = random.choice(list(meta))
        while (
            isinstance(holder[key], dict | list)
            and holder[key]
            and random.random() < 0.8
        ):
            holder = holder[key]
            key = random.choice(
                list(holder) if isinstance(holder, dict) else range(len(holder))
            )
        match random.randrange(4):
            case 0:
                del holder[key]
            case 1:
                holder[key] = random.choice(({}, [], None, True, [[]], {"a": {}}))
            case 2:
                holder[key] = random.choice(TEXTS)
            case _:
                numbers = [n for n in NUMBERS if abs(n) < 1e301 or n != n]
                holder[key] = random.choice(numbers)
        if not meta:
            break
    return np.array(json.dumps(meta))


def _lying(data: bytes, random: Random) -> bytes:
    """Change sizes: in the directory, in local headers, or in an array's own."""
    match random.randrange(4):
        case 0:
            return _bomb(random.choice((10**6, 10**8, 3 * 10**9)))
        case 1:
            shape = random.choice(
                ((10**12,), (10**9, 10**9), (-1,), (2**63,), (0, 10**30))
            )
            return _headed(data, shape)
        case 2:
            at = data.rfind(b"PK\x01\x02")
            return data[: at + 24] + struct.pack("<I", 2**31) + data[at + 28 :]
        case _:
            at = data.find(b"PK\x03\x04", random.randrange(len(data)))
            at = max(at, 0)
            return data[: at + 18] + random.randbytes(8) + data[at + 26 :]


def _bomb(size: int) -> bytes:
    """Return an archive that unpacks to a thousand times its size."""
    file = io.BytesIO()
    header = io.BytesIO()
    described = {"descr": "<f8", "fortran_order": False, "shape": (size // 8,)}
    np.lib.format.write_array_header_1_0(header, described)
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("t.npy", "w", force_zip64=True) as entry,
    ):
        entry.write(header.getvalue())
        written, block = 0, bytes(1 << 20)
        while written < min(size, 3 * 10**7):  # then the directory is made to lie
            written += entry.write(block)
    data = file.getvalue()
    if size > written:
        at = data.rfind(b"PK\x01\x02")
        data = (
            data[: at + 24] + struct.pack("<I", min(size, 2**32 - 2)) + data[at + 28 :]
        )
    return data


def _headed(data: bytes, shape: tuple[int, ...]) -> bytes:
    """Return a log with an array that says it has another shape."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    file = io.BytesIO(packed(arrays))
    with zipfile.ZipFile(file, "a") as archive:
        header = io.BytesIO()
        described = {"descr": "<f8", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(header, described)
        archive.writestr("more.npy", header.getvalue() + bytes(80))
    return file.getvalue()
