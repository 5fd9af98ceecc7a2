"""The saved form of a plan: its memory, its calls, the robots that they share.

A plan is calls on arrays of NumPy. Arrays that overlap are one block, so that one
call reads the output of another, and each block keeps its alignment to the processor's
vectors: the order of a sum, and so its last bit, may depend on it. The kinds of calls
are named, and their arguments by their members' names; nothing here is of one kind.

``engine/frozen/frozen_plan.cpp`` reads the result of `Image.content`:

    magic, CRC-32 of the rest, the engine's build, memory, objects, the move, the stop,
    ports

Numbers are those of this computer, which another one refuses.
"""

import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.errors import FreezeError
from hsp_control.engine import BUILD, Call, Dynamics, Move, Plan, PythonCall
from hsp_control.engine.own_kinds import library_of_own

_MAGIC = b"hsp_step"
_PACKET = 16
"""Bytes that the engine loads at once: SSE2, NEON. NumPy's memory begins at multiples
of it."""


RAMPED, PAYLOAD, SPRING = b"i", b"p", b"s"
"""Kinds of inputs: a value that may ramp, a payload, or some numbers of an
impedance."""
TARGET, VELOCITY, RATE, TIME = b"t", b"v", b"r", b"c"
"""Kinds of messages to a stream: a target, or a velocity; velocity and time of the next
target."""


class Port(NamedTuple):
    """A named input or output: an array of the plan."""

    name: str
    unit: str
    meaning: str
    array: Any  # float64 or int64, contiguous
    # the call that receives the input, of the kind Evolve, Stream, Payloads or
    # EvolveImpedance; None: an output
    input: Call | None = None
    role: bytes = RAMPED


class Image:
    """A plan, its memory, and the names of some of its arrays."""

    def __init__(self, move: Move, ports: Sequence[Port], stop: Move | None) -> None:
        """Collect the calls of a move, and those of the safe stop.

        Raises:
            FreezeError: If a Python function is among them.
        """
        self._objects: list[bytes] = []
        self._found: dict[int, int] = {}  # the number of an object, by its identity
        self._kept: list[object] = []  # whose identities these are
        seen: set[int] = set()
        moves = *_arrays(move, seen), *_arrays(stop, seen)  # None has none
        arrays = [*moves, *(port.array for port in ports)]
        self._memory = _Memory(arrays)
        self._move = self._number(move)
        self._stop = self._move if stop is None else self._number(stop)
        self._ports = [self._port(port) for port in ports]

    def content(self) -> bytes:
        """Return the bytes of the file."""
        memory = self._memory.content()
        body = b"".join(
            [
                _text(BUILD),
                struct.pack("=Q", len(memory)),
                memory,
                _count(self._objects),
                *self._objects,
                struct.pack("=2I", self._move, self._stop),
                _count(self._ports),
                *self._ports,
            ]
        )
        return _MAGIC + struct.pack("=I", zlib.crc32(body)) + body

    def _number(self, item: object) -> int:
        """Return the number of an object, which follows all that it names."""
        if id(item) not in self._found:
            content = self._object(item)
            self._found[id(item)] = len(self._objects)
            self._objects.append(content)
            self._kept.append(item)
        return self._found[id(item)]

    def _object(self, item: object) -> bytes:
        if isinstance(item, Dynamics):
            made: Any = item.__reduce__()
            joints, gravity, armature = made[1]
            own = [_joint(each) for each in joints]
            besides = _numbers(gravity), _count(armature), _numbers(armature)
            return b"".join([b"d", _count(own), *own, *besides])
        if isinstance(item, Plan):
            numbers = [self._number(each) for each in item.calls]
            return b"p" + struct.pack(f"={1 + len(numbers)}I", len(numbers), *numbers)
        if isinstance(item, Move):
            return self._call("", "Move", item.values)
        if isinstance(item, Call):
            kind = item.kind
            return self._call(library_of_own(kind), kind.name, item.values)
        raise FreezeError(refusal(item))

    def _call(self, library: str, kind: str, values: Mapping[str, Any]) -> bytes:
        arguments = [
            _text(name) + self._argument(value) for name, value in values.items()
        ]
        return b"".join(
            [b"c", _text(library), _text(kind), _count(arguments), *arguments]
        )

    def _argument(self, value: Any) -> bytes:
        if isinstance(value, np.ndarray):
            place = self._memory.place(value)
            return struct.pack(f"={value.ndim}qQ", *value.shape, place)
        if isinstance(value, Plan | Move | Dynamics):
            return struct.pack("=I", self._number(value))
        return struct.pack("=d", value)

    def _port(self, port: Port) -> bytes:
        texts = _text(port.name) + _text(port.unit) + _text(port.meaning)
        letters = b"d" if port.array.dtype == np.float64 else b"i"
        letters += b"o" if port.input is None else port.role
        place = struct.pack("=qQ", port.array.size, self._memory.place(port.array))
        if port.input is not None:
            place += struct.pack("=I", self._number(port.input))
        return texts + letters + place


class _Memory:
    """Blocks of memory, one after the other, and where arrays are in them."""

    def __init__(self, arrays: Iterable[Any]) -> None:
        # Equal addresses and sizes are one block; in the order of discovery, so that
        # the same controller gives the same file.
        self._arrays = {
            (each.ctypes.data, each.nbytes): each for each in arrays if each.nbytes
        }
        spans: list[tuple[int, int]] = []  # of blocks, by address
        for begin, size in sorted(self._arrays):
            if spans and begin < spans[-1][1]:
                spans[-1] = spans[-1][0], max(spans[-1][1], begin + size)
            else:
                spans.append((begin, begin + size))
        self._begins = [begin for begin, _ in spans]
        self._places: dict[int, int] = {}  # of blocks in the file, by address
        self._size = 0
        for begin, _ in self._arrays:
            start, end = spans[bisect_right(self._begins, begin) - 1]
            if start not in self._places:
                self._size += (start - self._size) % _PACKET
                self._places[start] = self._size
                self._size += end - start

    def place(self, array: Any) -> int:
        """Return where an array begins."""
        if not array.nbytes:
            return 0
        begin = array.ctypes.data
        start = self._begins[bisect_right(self._begins, begin) - 1]
        return self._places[start] + int(begin) - start

    def content(self) -> bytes:
        """Return the present contents of the memory."""
        memory = bytearray(self._size)
        for array in self._arrays.values():
            place = self.place(array)
            memory[place : place + array.nbytes] = array.tobytes("A")
        return bytes(memory)


def refusal(item: object) -> str:
    """Return why an object cannot be saved."""
    what = _name(item.function) if isinstance(item, PythonCall) else repr(item)
    return f"{what:.200} is Python, which a frozen controller runs without"


def _name(function: Any) -> str:
    """Return the name of a function, or of the class whose method it is."""
    if isinstance(function, partial):
        given = [*function.args, *function.keywords.values()]
        function = next(filter(callable, given), function.func)
    owner = getattr(function, "__self__", None)
    if owner is not None:
        return type(owner).__name__
    return str(getattr(function, "__qualname__", repr(function)))


def _arrays(item: object, seen: set[int]) -> Iterable[Any]:
    """Yield the arrays of all calls that something makes."""
    if id(item) in seen:
        return
    seen.add(id(item))
    inner: Iterable[object] = ()
    if isinstance(item, Plan):
        inner = item.calls
    elif isinstance(item, Call | Move):
        inner = item.values.values()
    for each in inner:
        if isinstance(each, np.ndarray):
            yield each
        else:
            yield from _arrays(each, seen)


def _text(text: str) -> bytes:
    content = text.encode()
    return struct.pack("=I", len(content)) + content


def _count(items: Sequence[object]) -> bytes:
    return struct.pack("=I", len(items))


def _numbers(numbers: Sequence[float]) -> bytes:
    return struct.pack(f"={len(numbers)}d", *numbers)


def _joint(joint: Any) -> bytes:
    parts = [_joint(each) for each in joint.parts]
    return b"".join(
        [
            _text(joint.name),
            _text(joint.type),
            struct.pack("=q", joint.parent),
            _numbers((*joint.placement, *joint.axis, joint.pitch)),
            struct.pack("=q", joint.leader),
            _numbers((joint.ratio, joint.offset)),
            _count(parts),
            *parts,
            _numbers((joint.mass, *joint.center, *joint.inertia)),
        ]
    )
