"""Run a simulated robot in real time, connected by UDP."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic, sleep

from hsp_control.common.arrays import Array
from hsp_control.live.link import Link
from hsp_control.live.packets import Kind
from hsp_control.live.real_time import no_garbage_collection
from hsp_control.live.safe_stop import Phase
from hsp_control.live.sensor_layout import SensorLayout
from hsp_control.live.simulated_robot import SimulatedRobot

CLOSED_BY_LOOP = "the loop closed the connection"
"""Why a robot stops at the regular end of a run."""


@dataclass
class ServerReport:
    """What `serve` counted."""

    # number of efforts that were ignored, because they were computed from a state older
    # than the watchdog's limit
    outdated: int = 0
    # by how much the robot's time fell behind real time, because its process did not
    # get the processor [s]
    overrun: float = 0.0
    never_started: bool = False  # whether no effort arrived


Row = Callable[[float, Array, Array, bool], object]
"""Called with t [s], q, shape (nq,), and v, shape (nv,), at the beginning of a period,
and whether it is the last one."""


def serve(
    robot: SimulatedRobot,
    link: Link,
    *,
    stop_reason: Callable[[], str | None],
    start_timeout: float = 60.0,
    on_row: Row | None = None,
) -> ServerReport:
    """Run a robot in real time, until it has stopped and was held.

    Each period: receive efforts, advance the plant, send the state. An effort that
    arrives within the period of its state acts from that state on, as if it had been
    computed in no time; a later one acts from the next period on.

    If this process overruns by more than a period, the robot's time stands still
    meanwhile, so that the loop's efforts do not count as late.

    Args:
        robot: The robot, waiting for its first effort.
        link: The connection; its peer is known.
        stop_reason: Called every period; returns a reason to stop, or None.
        start_timeout: Longest time to wait for the first effort [s].
        on_row: Called after the state was sent, in the rest of the period.

    Returns:
        The counts.
    """
    report, nv = ServerReport(), robot.plant.robot.nv
    sensors = SensorLayout.of(robot.measured())
    state_sequence = 0
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
            for packet in link.receive(0.0):
                if packet.kind is Kind.BYE:
                    robot.halt(CLOSED_BY_LOOP)
                elif packet.kind is Kind.EFFORT and len(packet.payload) == nv:
                    if state_sequence - packet.acks > robot.watchdog:
                        report.outdated += 1
                    else:
                        efforts.append(packet.payload)
            reason = stop_reason()
            if robot.phase == Phase.WAITING and not efforts:
                if reason is not None or monotonic() > give_up or robot.halted:
                    report.never_started = True
                    return report
            elif reason is not None:
                robot.halt(reason)
            t, q, v = robot.t, robot.q, robot.v
            robot.advance(efforts)
            state = sensors.pack(robot.measured())
            with suppress(OSError):  # a line that fails loses packets
                link.send(Kind.STATE, state, t=robot.t, phase=int(robot.phase))
            state_sequence = link.counts["sent"]
            done = robot.done
            if on_row is not None and robot.t > t:
                on_row(t, q, v, done)
            if done:
                return report
