"""Datagrams between a loop and a robot: a fixed binary layout, checked to the last bit.

All little-endian:

    magic     4 bytes   HSPC
    version   1 byte    1
    kind      1 byte    1 state, 2 effort, 3 bye
    phase     1 byte    of the robot, see `Phase`
    (zero)    1 byte
    count     4 bytes   of numbers in the payload
    session   8 bytes   of both processes' run: others' packets are not for us
    sequence  8 bytes   grows by one with every packet of this sender, from 1
    answers   8 bytes   sequence of the newest packet that the sender had seen
    stamp     8 bytes   when it was sent, on the sender's monotonic clock [ns]
    t         8 bytes   time of the payload [s], a double
    payload   8 count   doubles: q and v of a state, tau of an effort
    check     4 bytes   CRC-32 of all before
"""

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array

MAGIC, VERSION = b"HSPC", 1
_HEAD = struct.Struct("<4sBBBxIQQQqd")
_CHECK = struct.Struct("<I")


class Kind(IntEnum):
    """What a packet is."""

    STATE = 1
    EFFORT = 2
    BYE = 3


class Packet(NamedTuple):
    """A datagram's content.

    Attributes:
        kind: What it is.
        phase: The robot's phase.
        session: Of which run.
        sequence: The sender's number of it.
        answers: The newest packet that the sender had seen.
        stamp: When it was sent, on the sender's clock [ns].
        t: Time of the payload [s].
        payload: The numbers.
    """

    kind: Kind
    phase: int
    session: int
    sequence: int
    answers: int
    stamp: int
    t: float
    payload: Array


def encode(packet: Packet) -> bytes:
    """Return a packet as bytes."""
    numbers = np.asarray(packet.payload, dtype="<f8").tobytes()
    head = _HEAD.pack(
        MAGIC,
        VERSION,
        packet.kind,
        packet.phase,
        len(packet.payload),
        packet.session,
        packet.sequence,
        packet.answers,
        packet.stamp,
        packet.t,
    )
    body = head + numbers
    return body + _CHECK.pack(zlib.crc32(body))


def decode(data: bytes) -> Packet | None:
    """Return bytes as a packet; None if they are not one, whole and unchanged."""
    if len(data) < _HEAD.size + _CHECK.size:
        return None
    body = data[: -_CHECK.size]
    if _CHECK.unpack(data[-_CHECK.size :])[0] != zlib.crc32(body):
        return None
    head = _HEAD.unpack_from(body)
    magic, version, kind, phase, count = head[:5]
    if magic != MAGIC or version != VERSION or kind not in _KINDS:
        return None
    if len(body) != _HEAD.size + 8 * count:
        return None
    session, sequence, answers, stamp, t = head[5:]
    payload = np.frombuffer(body, "<f8", offset=_HEAD.size)
    return Packet(Kind(kind), phase, session, sequence, answers, stamp, t, payload)


_KINDS = frozenset(Kind)
