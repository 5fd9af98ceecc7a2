"""One end of a UDP connection: send packets, check those received, inject faults.

Datagrams have a fixed binary layout with a checksum. All numbers are little-endian:

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
    payload 8 count doubles: q and v of a state, readings of its other sensors
                        (`SensorLayout`), and the effort that the robot has, if it has
                        one; tau of an effort
    check     4 bytes   CRC-32 of all bytes before
"""

import socket
import struct
import zlib
from collections import Counter
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from select import select
from time import monotonic, monotonic_ns
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.common.host_names import check_host_name
from hsp_control.common.suggestions import did_you_mean

MAGIC, VERSION = b"HSPC", 1
_HEAD = struct.Struct("<4sBBBxIQQQqd")
_CHECK = struct.Struct("<I")


class PacketKind(IntEnum):
    """Kind of a packet: a state, an effort, or the end of the session."""

    STATE = 1
    EFFORT = 2
    BYE = 3


class Packet(NamedTuple):
    """The content of a datagram."""

    kind: PacketKind  # state, effort or end of the session
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
    if magic != MAGIC or version != VERSION or kind not in _PACKET_KINDS:
        return None
    if len(body) != _HEAD.size + 8 * count:
        return None
    session, sequence, acks, stamp, t = head[5:]
    payload = np.frombuffer(body, "<f8", offset=_HEAD.size)
    return Packet(PacketKind(kind), phase, session, sequence, acks, stamp, t, payload)


_PACKET_KINDS = frozenset(PacketKind)


@dataclass(frozen=True)
class Faults:
    """Probabilities of packet faults; a packet has one fault at most.

    Attributes:
        late: Probability that a packet is delayed behind later ones.
        lost: Probability that it is not sent.
        duplicated: Probability that it is sent twice.
        corrupted: Probability that one of its bits is inverted.
        delay: Number of packets that are sent before a late one.
        seed: Seed of the random numbers.
    """

    late: float = 0.0
    lost: float = 0.0
    duplicated: float = 0.0
    corrupted: float = 0.0
    delay: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        for name in _KINDS:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise LiveError(
                    f"{name} is {getattr(self, name)}; needs a probability, 0 to 1"
                )
        if sum(getattr(self, name) for name in _KINDS) > 1.0 + 1e-12:
            raise LiveError("the probabilities of the faults add up to more than 1")
        if self.delay < 1:
            raise LiveError(f"delay is {self.delay}; needs at least 1 packet")
        if self.seed < 0:
            raise LiveError(f"seed is {self.seed}; must not be negative")

    @classmethod
    def parse(cls, text: str) -> "Faults":
        """Parse a text such as ``late=0.01,lost=0.02,seed=3``.

        Raises:
            LiveError: If a name is unknown, or a value is not a valid number.
        """
        known = {field.name: field.type for field in fields(cls)}
        values: dict[str, float | int] = {}
        for part in filter(None, text.split(",")):
            name, _, number = (piece.strip() for piece in part.partition("="))
            if name not in known:
                raise LiveError(
                    f"no fault {name!r}{did_you_mean(name, known)} "
                    f"(there are {', '.join(known)})"
                )
            whole = name in {"delay", "seed"}
            try:
                values[name] = int(number) if whole else float(number)
            except ValueError:
                needs = "an integer" if whole else "a number"
                needs += f", as {name}={3 if whole else 0.01}"
                raise LiveError(f"fault {name} is {number!r}; needs {needs}") from None
        return cls(**values)  # type: ignore[arg-type]

    def as_json(self) -> dict[str, float]:
        """Return the settings as JSON data."""
        return asdict(self)


_KINDS = ("late", "lost", "duplicated", "corrupted")


class FaultInjector:
    """Applies `Faults` to packets."""

    def __init__(self, faults: Faults, stream: int = 0) -> None:
        self._faults = faults
        self._rng = np.random.default_rng((faults.seed, stream))
        self._cumulative = np.cumsum([getattr(faults, kind) for kind in _KINDS])
        self._waiting: list[tuple[int, bytes]] = []
        self.injected: Counter[str] = Counter(dict.fromkeys(_KINDS, 0))

    def apply(self, data: bytes) -> list[bytes]:
        """Return the packets to send now in place of this one, in order."""
        released = [late for left, late in self._waiting if left <= 1]
        self._waiting = [(left - 1, late) for left, late in self._waiting if left > 1]
        which = int(np.searchsorted(self._cumulative, self._rng.random(), side="right"))
        if which == len(_KINDS):
            return [data, *released]
        kind = _KINDS[which]
        self.injected[kind] += 1
        if kind == "late":
            self._waiting.append((self._faults.delay, data))
            return released
        if kind == "lost":
            return released
        if kind == "duplicated":
            return [data, data, *released]
        corrupted = bytearray(data)
        bit = int(self._rng.integers(8 * len(data)))
        corrupted[bit // 8] ^= 1 << (bit % 8)
        return [bytes(corrupted), *released]

    def flush(self) -> list[bytes]:
        """Return the remaining late packets, before the last packet is sent."""
        waiting, self._waiting = self._waiting, []
        return [data for _, data in waiting]


Address = tuple[str, int]

LOOPBACK = "127.0.0.1"
_BUFFER = 4 << 20
"""Size of the receive buffer [bytes]: some thousand packets."""
_MAX_DATAGRAM = 65536
_NOTHING = np.zeros(0)
_END_OF_TURN = b""
"""An empty datagram after the packets of a turn, which faults may hold back."""


class Link:
    """One end of a UDP connection.

    Every received packet is one of: accepted; corrupted (incomplete or changed);
    foreign (of another session, or of a kind that the other end does not send: our own,
    reflected); duplicated (the newest again); stale (older than the newest). `receive`
    returns the accepted ones only.
    """

    def __init__(
        self,
        session: int,
        address: Address = (LOOPBACK, 0),
        *,
        peer: Address | None = None,
        faults: Faults | None = None,
        stream: int = 0,
        receives: PacketKind | None = None,
    ) -> None:
        """Open the socket.

        Args:
            session: Number of the session.
            address: The address to listen at.
            peer: The other end's address; None: that of its first packet.
            faults: Faults to inject into packets sent.
            stream: Number of the stream of random numbers.
            receives: The kind that is received besides BYE; None: any.
        """
        self.session, self.peer = session, peer
        self._receives = receives
        self._faults = FaultInjector(faults or Faults(), stream)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with suppress(OSError):  # a smaller buffer works, too
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        try:
            check_host_name(address[0])
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise HardwareError(
                f"cannot listen at {address[0]}:{address[1]}: {error.strerror or error}"
            ) from error
        self.address: Address = self._socket.getsockname()
        self.newest = self._sent = 0
        self._byes: set[int] = set()  # when ours were sent [ns]
        self._turn: list[Packet] = []  # accepted, of a turn that has not ended
        self.counts: Counter[str] = Counter(
            dict.fromkeys(
                ("sent", "accepted", "corrupted", "foreign", "duplicated", "stale"), 0
            )
        )

    @property
    def injected(self) -> dict[str, int]:
        """Number of faults injected into sent packets, by kind."""
        return dict(self._faults.injected)

    @property
    def lost(self) -> int:
        """Packet loss: number of packets that the other end sent and did not arrive."""
        valid = self.counts["accepted"] + self.counts["stale"]
        return max(0, self.newest - valid - self.counts["corrupted"])

    def send(
        self,
        kind: PacketKind,
        payload: Array = _NOTHING,
        *,
        t: float = 0.0,
        phase: int = 0,
    ) -> None:
        """Send a packet; if the other end has closed, nothing happens."""
        if self.peer is None:
            raise HardwareError("no packet of the robot has arrived yet")
        self._sent += 1
        self.counts["sent"] += 1
        stamp = monotonic_ns()
        packet = Packet(
            kind, phase, self.session, self._sent, self.newest, stamp, t, payload
        )
        if kind is PacketKind.BYE:
            self._byes.add(stamp)
        # A BYE must arrive: faults are injected only into packets that are repeated.
        if kind is PacketKind.BYE:
            sent = [*self._faults.flush(), encode(packet)]
        else:
            sent = self._faults.apply(encode(packet))
        for data in sent:
            with suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.sendto(data, self.peer)

    def receive(self, timeout: float) -> list[Packet]:
        """Return the accepted packets, oldest first; none after `close`.

        Args:
            timeout: Maximum time to wait if there is none [s]; 0: do not wait.
        """
        accepted = self._drain() if self._socket.fileno() >= 0 else []
        if accepted or timeout <= 0.0 or self._socket.fileno() < 0:
            return accepted
        end = monotonic() + timeout
        while not accepted and (left := end - monotonic()) > 0.0:
            ready, _, _ = select([self._socket], [], [], left)
            if ready:
                accepted = self._drain()
        return accepted

    def end_turn(self) -> None:
        """Pass the turn to the other end, in lockstep; always arrives."""
        if self.peer is not None:
            with suppress(OSError):
                self._socket.sendto(_END_OF_TURN, self.peer)

    def turn(self, timeout: float) -> list[Packet] | None:
        """Return the accepted packets of the other end's turn, in lockstep.

        None if it does not end in time [s]; they are then returned later.
        """
        end = monotonic() + timeout
        while self._socket.fileno() >= 0:
            received = self._next()
            if received is None:
                ready, _, _ = select([self._socket], [], [], max(end - monotonic(), 0))
                if not ready:
                    return None
            elif received[0] == _END_OF_TURN and received[1] == self.peer:
                turn, self._turn = self._turn, []
                return turn
            elif (packet := self._classify(*received)) is not None:
                self._turn.append(packet)
        return None

    def close(self) -> None:
        """Close the socket; a second call does nothing."""
        self._socket.close()

    def _drain(self) -> list[Packet]:
        accepted: list[Packet] = []
        while (received := self._next()) is not None:
            data, sender = received
            if data == _END_OF_TURN and sender == self.peer:
                continue
            packet = self._classify(data, sender)
            if packet is not None:
                accepted.append(packet)
        return accepted

    def _next(self) -> tuple[bytes, Address] | None:
        while True:
            try:
                return self._socket.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                return None
            except ConnectionRefusedError:  # the other end had closed when we sent
                continue

    def _classify(self, data: bytes, sender: Address) -> Packet | None:
        packet = decode(data)
        kind = "accepted"
        if packet is None:
            kind = "corrupted"
        elif packet.session != self.session or self._is_reflected(packet):
            kind = "foreign"
        elif packet.sequence == self.newest:
            kind = "duplicated"
        elif packet.sequence < self.newest:
            kind = "stale"
        self.counts[kind] += 1
        if packet is None or kind != "accepted":
            return None
        self.newest, self.peer = packet.sequence, sender
        return packet

    def _is_reflected(self, packet: Packet) -> bool:
        """Return whether a packet is our own, or one of that kind."""
        if self._receives is not None and packet.kind is not PacketKind.BYE:
            return packet.kind is not self._receives
        return packet.kind is PacketKind.BYE and packet.stamp in self._byes


class AgeEstimator:
    """Estimates the age of packets without synchronised clocks.

    age = (arrival - stamp) - min over recent packets of (arrival - stamp): the packet
    with the smallest difference is assumed to have had no delay. Recent: in this time
    window or the one before, because clocks drift.
    """

    def __init__(self, window: float = 10.0) -> None:
        self._window = window
        self._smallest = self._smallest_before = np.inf
        self._end = -np.inf

    def age(self, arrival: float, stamp: float) -> float:
        """Return a packet's age [s]."""
        if arrival > self._end:
            self._smallest_before, self._smallest = self._smallest, np.inf
            self._end = arrival + self._window
        self._smallest = min(self._smallest, arrival - stamp)
        return arrival - stamp - min(self._smallest, self._smallest_before)
