"""Datagrams between a loop and a robot: a fixed binary layout with a checksum.

All numbers are little-endian:

    magic     4 bytes   HSPC
    version   1 byte    1
    kind      1 byte    1 state, 2 effort, 3 bye
    phase     1 byte    the robot's phase, see `Phase`
    (zero)    1 byte
    count     4 bytes   number of doubles in the payload
    session   8 bytes   number of the session; packets of others are ignored
    sequence  8 bytes   number of the packet at this sender, from 1
    acks      8 bytes   sequence of the newest packet that the sender has received
    stamp     8 bytes   when it was sent, on the sender's monotonic clock [ns]
    t         8 bytes   time of the payload [s], a double
    payload   8 count   doubles: q and v of a state, what its other sensors measure
                        (`SensorLayout`), and the effort that the robot has, if it has
                        one; tau of an effort
    check     4 bytes   CRC-32 of all bytes before
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
    """Kind of a packet: a state, an effort, or the end of the session."""

    STATE = 1
    EFFORT = 2
    BYE = 3


class Packet(NamedTuple):
    """The content of a datagram."""

    kind: Kind  # state, effort or end of the session
    phase: int  # the robot's phase
    session: int  # number of the session
    sequence: int  # number of the packet at its sender
    acks: int  # sequence of the newest packet that the sender has received
    stamp: int  # when it was sent, on the sender's clock [ns]
    t: float  # time of the payload [s]
    payload: Array  # the doubles, shape (count,)


def encode(packet: Packet) -> bytes:
    """Encode a packet as bytes."""
    numbers = np.asarray(packet.payload, dtype="<f8").tobytes()
    head = _HEAD.pack(
        MAGIC,
        VERSION,
        packet.kind,
        packet.phase,
        len(packet.payload),
        packet.session,
        packet.sequence,
        packet.acks,
        packet.stamp,
        packet.t,
    )
    body = head + numbers
    return body + _CHECK.pack(zlib.crc32(body))


def decode(data: bytes) -> Packet | None:
    """Decode bytes; return None if they are not a complete, unchanged packet."""
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
    session, sequence, acks, stamp, t = head[5:]
    payload = np.frombuffer(body, "<f8", offset=_HEAD.size)
    return Packet(Kind(kind), phase, session, sequence, acks, stamp, t, payload)


_KINDS = frozenset(Kind)
