"""Serves a watched robot over UDP, in real time."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic, sleep

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.latency import no_garbage_collection
from hsp_control.live.link import Link
from hsp_control.live.packets import Kind
from hsp_control.live.safe_stop import Phase
from hsp_control.live.watched_robot import WatchedRobot

BYE = "the loop said its end"
"""Why a robot stops that has served well."""


@dataclass
class Served:
    """What a server did.

    Attributes:
        outdated: Efforts that answered a state older than the watchdog's patience.
        slipped: By how much its clock fell behind, because it was not let run [s].
        waited: Whether no effort ever came.
    """

    outdated: int = 0
    slipped: float = 0.0
    waited: bool = False


Row = Callable[[float, Array, Array, bool], object]
"""Called with t [s], q and v at the beginning of a period, and if it is the last."""


def serve(
    robot: WatchedRobot,
    link: Link,
    *,
    orphaned: Callable[[], str | None],
    patience: float = 60.0,
    on_row: Row | None = None,
) -> Served:
    """Let a robot live in real time, until it has stopped and stood for a while.

    Each period it takes the efforts that came, moves, and sends its state. An effort
    that came within the period of its state acts from that state on, as if it had not
    taken any time; one that comes later, from the next period on.

    If this process is not let run for longer than a period, its clock stands still
    meanwhile: that is the simulator's fault, and nobody's lateness.

    Args:
        robot: The robot, waiting.
        link: The connection, which knows its peer.
        orphaned: Asked every period; a text is a reason to stop.
        patience: How long it waits for the first effort [s].
        on_row: What to do in the rest of a period.
    """
    served, nv = Served(), robot.plant.robot.nv
    sequence_of_state = 0
    with no_garbage_collection():
        begin = monotonic()
        give_up = begin + patience
        while True:
            begin += robot.period
            now = monotonic()
            if now < begin:
                sleep(begin - now)
            elif now - begin > robot.period:
                served.slipped += now - begin
                begin = now
            efforts = []
            for packet in link.receive(0.0):
                if packet.kind is Kind.BYE:
                    robot.halt(BYE)
                elif packet.kind is Kind.EFFORT and len(packet.payload) == nv:
                    if sequence_of_state - packet.answers > robot.watchdog:
                        served.outdated += 1
                    else:
                        efforts.append(packet.payload)
            reason = orphaned()
            if robot.phase == Phase.WAITING and not efforts:
                if reason is not None or monotonic() > give_up or robot.halted:
                    served.waited = True
                    return served
            elif reason is not None:
                robot.halt(reason)
            t, q, v = robot.t, robot.q, robot.v
            robot.advance(efforts)
            state = np.concatenate(robot.measure())
            link.send(Kind.STATE, state, t=robot.t, phase=int(robot.phase))
            sequence_of_state = link.counts["sent"]
            done = robot.done
            if on_row is not None and robot.t > t:
                on_row(t, q, v, done)
            if done:
                return served
