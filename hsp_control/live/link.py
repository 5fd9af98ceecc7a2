"""One end of a UDP connection: sends packets, and sorts out what comes."""

import socket
from collections import Counter
from contextlib import suppress
from select import select
from time import monotonic, monotonic_ns

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.live.faults import FaultInjector, Faults
from hsp_control.live.packets import Kind, Packet, decode, encode

Address = tuple[str, int]

LOOPBACK = "127.0.0.1"
_BUFFER = 4 << 20
"""Of what came and was not read [bytes]: some thousand packets."""
_LARGEST = 65536
_NOTHING = np.zeros(0)


class Link:
    """One end of a connection.

    Every packet that comes is one of: accepted; corrupted (not a whole packet); foreign
    (of another session); duplicated (the newest again); stale (older than the newest).
    Only accepted ones are passed on.

    Attributes:
        session: Of both ends.
        address: Of this end.
        peer: Of the other end; None until it was heard of.
        seen: Sequence of the newest packet that was accepted.
        counts: How many of each came, by the names above, and were ``sent``.
    """

    def __init__(
        self,
        session: int,
        address: Address = (LOOPBACK, 0),
        *,
        peer: Address | None = None,
        faults: Faults | None = None,
        stream: int = 0,
    ) -> None:
        """Open the socket.

        Args:
            session: A number that both ends know.
            address: Where to listen; port 0: any that is free.
            peer: The other end; None: whoever first sends a packet of the session.
            faults: What happens to packets that are sent.
            stream: Of the faults' random numbers.

        Raises:
            HardwareError: If there is no such address, or it is taken.
        """
        self.session, self.peer = session, peer
        self._faults = FaultInjector(faults or Faults(), stream)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with suppress(OSError):  # a smaller one does, too
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise HardwareError(
                f"cannot listen at {address[0]}:{address[1]}: {error.strerror or error}"
            ) from error
        self.address: Address = self._socket.getsockname()
        self.seen = self._sent = 0
        self.counts: Counter[str] = Counter(
            dict.fromkeys(
                ("sent", "accepted", "corrupted", "foreign", "duplicated", "stale"), 0
            )
        )

    @property
    def injected(self) -> dict[str, int]:
        """How many packets of each fault were sent."""
        return dict(self._faults.injected)

    @property
    def lost(self) -> int:
        """How many packets the other end sent and this one never had."""
        whole = self.counts["accepted"] + self.counts["stale"]
        return max(0, self.seen - whole - self.counts["corrupted"])

    def send(
        self, kind: Kind, payload: Array = _NOTHING, *, t: float = 0.0, phase: int = 0
    ) -> None:
        """Send a packet; where the other end is not there, nothing happens.

        Raises:
            HardwareError: If the other end was never heard of.
        """
        if self.peer is None:
            raise HardwareError("nothing was heard of the robot yet")
        self._sent += 1
        self.counts["sent"] += 1
        packet = Packet(
            kind,
            phase,
            self.session,
            self._sent,
            self.seen,
            monotonic_ns(),
            t,
            payload,
        )
        # A bye is what must arrive: faults are for what is repeated.
        if kind is Kind.BYE:
            sent = [*self._faults.rest(), encode(packet)]
        else:
            sent = self._faults.pass_on(encode(packet))
        for data in sent:
            with suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.sendto(data, self.peer)

    def receive(self, timeout: float) -> list[Packet]:
        """Return the accepted packets that came, oldest first; none once closed.

        Args:
            timeout: How long to wait for one if there is none [s]; 0: not at all.
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

    def close(self) -> None:
        """Close the socket; again is no error."""
        self._socket.close()

    def _drain(self) -> list[Packet]:
        accepted: list[Packet] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(_LARGEST)
            except BlockingIOError:
                return accepted
            except ConnectionRefusedError:  # what was sent before found nobody
                continue
            packet = self._sort(data, sender)
            if packet is not None:
                accepted.append(packet)

    def _sort(self, data: bytes, sender: Address) -> Packet | None:
        packet = decode(data)
        kind = "accepted"
        if packet is None:
            kind = "corrupted"
        elif packet.session != self.session:
            kind = "foreign"
        elif packet.sequence == self.seen:
            kind = "duplicated"
        elif packet.sequence < self.seen:
            kind = "stale"
        self.counts[kind] += 1
        if packet is None or kind != "accepted":
            return None
        self.seen, self.peer = packet.sequence, sender
        return packet


class Ages:
    """How old packets are, though the clocks of two ends have nothing in common.

    The least difference of arrival and stamp that was seen lately belongs to a packet
    that did not wait; what a packet's difference exceeds it by is its age. Lately: in
    this window of time or the one before, for clocks drift.
    """

    def __init__(self, window: float = 10.0) -> None:
        """Set the window's length [s]."""
        self._window = window
        self._least = self._before = np.inf
        self._end = -np.inf

    def age(self, arrival: float, stamp: float) -> float:
        """Return a packet's age [s], from when it came and was sent [s]."""
        if arrival > self._end:
            self._before, self._least = self._least, np.inf
            self._end = arrival + self._window
        self._least = min(self._least, arrival - stamp)
        return arrival - stamp - min(self._least, self._before)
