"""A robot that is connected by UDP: the loop's end, and that of a simulated one."""

import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from time import monotonic, sleep
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.measurement import Inertial, Measurement
from hsp_control.live.hardware import described
from hsp_control.live.link import (
    LOOPBACK,
    Address,
    AgeEstimator,
    Faults,
    Link,
    Packet,
    PacketKind,
)
from hsp_control.live.real_time import no_garbage_collection
from hsp_control.live.safe_stop import Phase
from hsp_control.live.simulated_robot import SimulatedRobot
from hsp_control.robot import Robot

_EACH = 6
"""Sizes of a wrench, and of a reading of an inertial measurement unit."""


class SensorLayout(NamedTuple):
    """The sensors on which both ends of a connection agree.

    The numbers of a state are q, v, then six of each wrench in this order, then those
    of the inertial measurement unit (angular velocity, specific force), and at the end
    the effort of the robot, if it reports one.
    """

    # the frames whose wrench is measured; see `Measurement.wrenches`
    wrenches: tuple[str, ...] = ()
    # the frame of the inertial measurement unit; None: there is none
    inertial: str | None = None

    @classmethod
    def of(cls, measured: Measurement) -> "SensorLayout":
        """Return the layout of a robot's measurements."""
        unit = measured.inertial
        return cls(tuple(measured.wrenches), None if unit is None else unit.frame)

    def pack(self, measured: Measurement) -> Array:
        """Return the numbers of a measurement with these sensors, shape (n,)."""
        parts = [measured.q, measured.v]
        parts += [measured.wrenches[frame] for frame in self.wrenches]
        if measured.inertial is not None:
            parts += measured.inertial[1:]
        if measured.applied is not None:
            parts.append(measured.applied)
        return np.concatenate(parts)

    def unpack(self, numbers: Array, robot: Robot) -> Measurement:
        """Return a measurement from its numbers; number and time of it are 0.

        With too few or too many numbers the last parts have wrong shapes, for
        `valid_measurement` to refuse.
        """
        sizes = [robot.nq, robot.nv] + [_EACH] * len(self.wrenches)
        sizes += [3, 3] if self.inertial is not None else []
        q, v, *rest = np.split(numbers, np.cumsum(sizes))
        inertial = None
        if self.inertial is not None:
            inertial = Inertial(self.inertial, rest[-3], rest[-2])
        return Measurement(
            0,
            0.0,
            q,
            v,
            applied=rest[-1] if rest[-1].size else None,
            wrenches=dict(zip(self.wrenches, rest, strict=False)),
            inertial=inertial,
        )


_PAUSE = 0.1
"""Time after which the other end is polled again [s]."""
_AGAIN = 0.5
"""Time between two states of a robot in lockstep that waits for an effort [s]."""
_BYES = 3
"""Number of BYE packets that are sent: one may be lost."""


class UdpHardware:
    """`Hardware` that exchanges `packets` with a robot, for example a simulated one.

    The robot sends its states to `address` with the number `session`; its own address
    is that of its first packet.

    Attributes:
        period: Time between two states [s].
        link: The connection, with its packet counters.
        real_time: Whether its time passes as ours does: not in lockstep.
        closed: Whether `close` was called.
    """

    def __init__(
        self,
        robot: Robot,
        period: float,
        *,
        address: Address = (LOOPBACK, 0),
        session: int | None = None,
        faults: Faults | None = None,
        sensors: SensorLayout | None = None,
        alive: Callable[[], bool] | None = None,
    ) -> None:
        """Open the socket.

        Args:
            robot: The model; gives the sizes nq and nv.
            period: Time between two states [s].
            address: The address to listen at; port 0: any free port.
            session: A number that the robot uses, too; None: a random one.
            faults: Faults to inject into the efforts sent.
            sensors: The robot's sensors besides those of q and v; None: none.
            alive: In lockstep with a robot that is served so: whether it still is; its
                next state is waited for as long. None: real time.

        Raises:
            HardwareError: If the address does not exist or is in use.
        """
        self.period = period
        self._robot = robot
        self._sensors = SensorLayout() if sensors is None else sensors
        session = secrets.randbits(63) if session is None else session
        self.link = Link(
            session, address, faults=faults, stream=1, receives=PacketKind.STATE
        )
        self._age_estimator = AgeEstimator()
        self._alive, self.real_time = alive, alive is None
        self._last: Measurement | None = None
        self._started = False  # whether an effort was sent
        self._our_turn = True
        self.closed = False

    @property
    def address(self) -> Address:
        """The address to which the robot must send its states."""
        return self.link.address

    @property
    def session(self) -> int:
        """The number of the session, which the robot must know."""
        return self.link.session

    def read(self, timeout: float) -> Measurement | None:
        """Return the newest state; see `Hardware.read`."""
        in_turn = self._alive is not None and self._started
        packets = self._robot_s_turn() if in_turn else self.link.receive(timeout)
        states = [p for p in packets if p.kind is PacketKind.STATE]
        for packet in states:
            age = self._age_estimator.age(monotonic(), 1e-9 * packet.stamp)
        if not states:
            # A robot in lockstep rests while it waits for its first effort.
            return None if in_turn or self.real_time else self._last
        measured = self._sensors.unpack(packet.payload, self._robot)
        self._last = measured._replace(
            sequence=packet.sequence,
            t=packet.t,
            age=age if self.real_time else 0.0,
            halted=packet.phase > Phase.RUNNING,
        )
        return self._last

    def _robot_s_turn(self) -> list[Packet]:
        """Wait for the robot's packets of its turn; none once it has ended."""
        self._end_turn()
        while (packets := self.link.turn(_PAUSE)) is None:
            if self._alive is not None and not self._alive():
                self._alive = None
                return []
        self._our_turn = True
        return packets

    def _end_turn(self) -> None:
        if self._alive is not None and self._our_turn:
            self.link.end_turn()
            self._our_turn = False

    def write(self, effort: Array) -> None:
        """Send an effort; see `Hardware.write`."""
        self.link.send(PacketKind.EFFORT, effort)
        self._started = True
        self._end_turn()

    def close(self) -> None:
        """Send the end of the session; packets that still arrive can be counted."""
        if not self.closed and self.link.peer is not None:
            for _ in range(_BYES):
                self.link.send(PacketKind.BYE)
            if not self.real_time:
                self.link.end_turn()
        self.closed = True

    def drain(self) -> None:
        """Count the packets that arrived after `close`, and close the socket."""
        self.link.receive(0.0)
        self.link.close()


CLOSED_BY_LOOP = "the loop closed the connection"
"""The reason of a robot's stop at the regular end of a run."""


@dataclass
class ServerReport:
    """The statistics of `serve`."""

    outdated: int = 0  # efforts for a state older than the watchdog's limit
    overrun: float = 0.0  # delay of its time behind real time [s]


Row = Callable[[float, Array, Array, bool], object]
"""Called with t [s], q, shape (nq,), and v, shape (nv,), at the beginning of a period,
and whether it is the last one."""


@contextmanager
def _halting(robot: SimulatedRobot, what: str) -> Iterator[None]:
    """Stop the robot at any error: nothing else would."""
    try:
        yield
    except BaseException as error:
        robot.halt(f"{what}: {described(error)}")


def serve(
    robot: SimulatedRobot,
    link: Link,
    *,
    stop_reason: Callable[[], str | None],
    start_timeout: float = 60.0,
    on_rows: Sequence[Row] = (),
    lockstep: bool = False,
) -> ServerReport:
    """Run a robot in real time, until it has stopped and was held.

    In a period: receive efforts, advance the plant, send the state. An effort that
    arrives within the period of its state acts from that state on, as if it had been
    computed instantly; a later one acts from the next period on.

    If this process overruns by more than a period, the robot's time stands still
    meanwhile, so that the loop's efforts are not late.

    In lockstep a period also waits until the loop has ended its turn, which it has with
    each state: neither is ever late, however busy the computer.

    An exception of the connection or of ``on_rows`` stops the robot, too; then
    ``on_rows`` is not called any more.

    Args:
        robot: The robot, waiting for its first effort.
        link: The connection; its peer is known.
        stop_reason: Called every period; returns a reason to stop, or None.
        start_timeout: Maximum time to wait for the first effort [s], in lockstep for
            each.
        on_rows: Called after the state was sent, in the rest of the period.
        lockstep: Whether to wait for the loop.

    Returns:
        The counters.
    """
    report, nv = ServerReport(), robot.plant.robot.nv
    sensors = SensorLayout.of(robot.measured())
    state_sequence = 0
    alone = False  # whether the loop has ended

    def received() -> list[Packet]:
        nonlocal alone
        if not lockstep or alone:
            return link.receive(0.0)
        if robot.phase == Phase.WAITING:
            return link.turn(_AGAIN) or []
        end = monotonic() + start_timeout
        while (packets := link.turn(_PAUSE)) is None:
            if stop_reason() is not None:
                return []
            if monotonic() > end:
                robot.halt(f"the loop did not answer for {start_timeout:g} s")
                alone = True  # otherwise every period of the stop would wait as long
                return []
        return packets

    with no_garbage_collection():
        begin = monotonic()
        give_up = begin + start_timeout
        while True:
            begin += robot.period
            now = monotonic()
            if now < begin:
                sleep(begin - now)
            elif now - begin > robot.period:
                report.overrun += now - begin
                begin = now
            efforts = []
            with _halting(robot, "no effort can be received"):
                for packet in received():
                    if packet.kind is PacketKind.BYE:
                        robot.halt(CLOSED_BY_LOOP)
                        alone = True
                    elif packet.kind is PacketKind.EFFORT and len(packet.payload) == nv:
                        if state_sequence - packet.acks > robot.watchdog:
                            report.outdated += 1
                        else:
                            efforts.append(packet.payload)
            reason = stop_reason()
            if robot.phase == Phase.WAITING and not efforts:
                if reason is not None or monotonic() > give_up or robot.halted:
                    return report
            elif reason is not None:
                robot.halt(reason)
                alone = True
            t, q, v = robot.t, robot.q, robot.v
            robot.advance(efforts)
            state = sensors.pack(robot.measured())
            with _halting(robot, "no state can be sent"), suppress(OSError):
                # A failing connection loses packets.
                link.send(PacketKind.STATE, state, t=robot.t, phase=int(robot.phase))
            if lockstep and robot.phase != Phase.WAITING:
                link.end_turn()
            state_sequence = link.counts["sent"]
            done = robot.done
            if robot.t > t:
                rows, on_rows = on_rows, ()
                with _halting(robot, "its period cannot be reported"):
                    for on_row in rows:
                        on_row(t, q, v, done)
                    on_rows = rows
            if done:
                return report
