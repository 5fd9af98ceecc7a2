"""Datagrams, faults and links: every packet is sorted, every fault is counted."""

import struct
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from live_rigs import PERIOD, start, watched
from loaded_robots import panda
from odd_errors import OddError
from places import covering

from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.live import (
    Faults,
    Hardware,
    Link,
    LiveSettings,
    Phase,
    UdpHardware,
    serve,
    udp,
)
from hsp_control.live.link import (
    AgeEstimator,
    FaultInjector,
    Packet,
    PacketKind,
    decode,
    encode,
)
from hsp_control.live.udp import CLOSED_BY_LOOP

numbers = st.lists(st.floats(), max_size=20)


def packet(sequence: int = 1, payload: list[float] | None = None) -> Packet:
    values = np.array([1.5, -2.0] if payload is None else payload)
    return Packet(PacketKind.STATE, 1, 7, sequence, 3, -5, 0.25, values)


def same(a: Packet, b: Packet) -> bool:
    return a[:-1] == b[:-1] and np.array_equal(a.payload, b.payload, equal_nan=True)


# --- packets -------------------------------------------------------------------------


@given(payload=numbers, data=st.data())
def test_one_bit_is_enough_to_be_refused(
    payload: list[float], data: st.DataObject
) -> None:
    sent = bytearray(encode(packet(1, payload)))
    bit = data.draw(st.integers(0, 8 * len(sent) - 1))
    sent[bit // 8] ^= 1 << (bit % 8)
    assert decode(bytes(sent)) is None


@given(junk=st.binary(max_size=200), cut=st.integers(0, 71))
def test_junk_and_pieces_are_refused(junk: bytes, cut: int) -> None:
    whole = encode(packet())
    assert decode(whole[:cut]) is None
    assert decode(whole + junk) is None or not junk
    assume(junk != whole)
    assert decode(junk) is None


def test_other_versions_kinds_and_lengths_are_refused() -> None:
    import zlib

    whole = encode(packet())
    for at, value in ((0, b"X"), (4, b"\x02"), (5, b"\x09"), (8, b"\x03")):
        body = whole[:at] + value + whole[at + 1 : -4]
        assert decode(body + struct.pack("<I", zlib.crc32(body))) is None


# --- faults --------------------------------------------------------------------------


@given(seed=st.integers(0, 1000), delay=st.integers(1, 5))
def test_each_fault_has_its_effect_and_is_counted(seed: int, delay: int) -> None:
    faults = Faults(0.2, 0.2, 0.2, 0.2, delay=delay, seed=seed)
    injector = FaultInjector(faults)
    came: list[int | None] = []
    for k in range(1, 201):
        for data in injector.apply(encode(packet(k))):
            found = decode(data)
            came.append(None if found is None else found.sequence)
    came += [found.sequence for d in injector.flush() if (found := decode(d))]
    done = injector.injected
    whole = [k for k in came if k is not None]
    assert came.count(None) == done["corrupted"]
    assert len(whole) - len(set(whole)) == done["duplicated"]
    assert 200 - len(set(whole)) == done["lost"] + done["corrupted"]
    behind = [k for i, k in enumerate(whole) if whole[:i] and k < max(whole[:i])]
    assert len(behind) <= done["late"]
    assert sum(done.values()) == pytest.approx(160, abs=30)
    again = FaultInjector(faults)  # the same seed, the same faults
    for k in range(1, 201):
        again.apply(encode(packet(k)))
    assert again.injected == done


def test_faults_are_parsed_and_refused() -> None:
    assert Faults.parse("") == Faults()
    assert Faults.parse("late=0.1, lost=0.02,delay=7,seed=3") == Faults(
        late=0.1, lost=0.02, delay=7, seed=3
    )
    for text, message in (
        ("loss=0.1", "no fault 'loss'; did you mean 'lost'"),
        ("lost", "fault lost is ''; needs a number"),
        ("seed=0.5", "fault seed is '0.5'; needs an integer, as seed=3"),
        ("seed=-1", "seed is -1; must not be negative"),
        ("lost=1.5", "lost is 1.5; needs a probability"),
        ("lost=0.6,late=0.6", "add up to more than 1"),
        ("delay=0", "delay is 0"),
    ):
        with pytest.raises(LiveError, match=message.replace("'", ".")):
            Faults.parse(text)


# --- links ---------------------------------------------------------------------------


@pytest.fixture
def links() -> Iterator[tuple[Link, Link]]:
    receiver = Link(7)
    sender = Link(7, peer=receiver.address)
    yield sender, receiver
    sender.close()
    receiver.close()


def test_a_link_sorts_its_packets(links: tuple[Link, Link]) -> None:
    sender, receiver = links
    raw = sender._socket
    foreign = encode(packet(1)._replace(session=8))
    data = [encode(packet(k)) for k in range(1, 7)]
    broken = data[4][:-1]
    for each in (data[0], data[0], data[2], data[1], broken, foreign, data[5], data[5]):
        raw.sendto(each, receiver.address)
    accepted = receiver.receive(5.0)
    assert [p.sequence for p in accepted] == [1, 3, 6]
    assert receiver.counts == {
        "sent": 0, "accepted": 3, "duplicated": 2, "stale": 1, "corrupted": 1,
        "foreign": 1,
    }  # fmt: skip
    # 1, 3 and 6 arrived, 2 was late, one was corrupted: one more is lost.
    assert receiver.lost == 1
    assert receiver.peer == sender.address
    assert receiver.receive(0.0) == []


def test_no_peer_and_no_free_address() -> None:
    link = Link(7)
    with pytest.raises(HardwareError, match="no packet of the robot has arrived yet"):
        link.send(PacketKind.EFFORT)
    with pytest.raises(HardwareError, match=r"cannot listen at 127\.0\.0\.1"):
        Link(7, link.address)
    with pytest.raises(HardwareError, match="not a host name"):
        Link(7, (70 * "ö", 0))
    link.close()


@pytest.mark.slow
@given(
    offset=st.floats(-1e6, 1e6),
    drift=st.floats(-1e-5, 1e-5),
    delays=st.lists(st.floats(0.0, 0.1), min_size=200, max_size=200),
)
def test_age_is_the_delay_beyond_that_of_the_fastest_packet(
    offset: float, drift: float, delays: list[float]
) -> None:
    ages = AgeEstimator(window=1.0)
    delays = [0.0 if k % 10 == 0 else delay for k, delay in enumerate(delays)]
    for k, delay in enumerate(delays):
        sent = 0.1 * k
        age = ages.age(sent + delay, offset + sent * (1.0 + drift))
        # Clocks drift by 1e-5 of the two windows; 1e6 s have 1e-10 s of rounding.
        assert age == pytest.approx(delay, abs=2.5e-5)


# --- a robot at the other end, both in this process ----------------------------------


@pytest.mark.slow
def test_a_served_robot_runs_stops_and_gives_the_reason() -> None:
    hardware = UdpHardware(panda(), PERIOD)
    assert isinstance(hardware, Hardware)
    robot = watched()
    link = Link(hardware.session, peer=hardware.address)
    tau = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    seen: list[int] = []

    def pilot() -> None:  # the server polls every period: now the loop's
        found = hardware.read(0.0)
        if found is None:
            return
        seen.append(found.sequence)
        if len(seen) < 50:
            hardware.write(tau)
        elif not hardware.closed:
            hardware.close()

    serve(robot, link, stop_reason=pilot)  # type: ignore[arg-type]
    assert robot.reason == CLOSED_BY_LOOP
    assert robot.phase is Phase.HOLDING
    assert robot.done
    assert link.counts["accepted"] == 49 + 3
    hardware.drain()
    assert hardware.link.counts["accepted"] == link.counts["sent"]
    link.close()


@pytest.mark.slow
def test_efforts_that_answer_old_states_are_ignored() -> None:
    """Efforts that all arrive in order, but too late, are silence."""
    receiver, robot = Link(7), watched(LiveSettings(watchdog=10))
    link = Link(7, peer=receiver.address)
    tau = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    receiver.newest = 0

    def pilot() -> None:
        newest = receiver.receive(0.0)
        if newest and robot.t > 0.05:
            receiver.newest = 20  # it answers an old state
        if newest:
            receiver.send(PacketKind.EFFORT, tau)

    served = serve(robot, link, stop_reason=pilot)  # type: ignore[arg-type]
    assert robot.reason.startswith("the watchdog")
    assert served.outdated > 10
    receiver.close()
    link.close()


@pytest.mark.slow
@pytest.mark.parametrize(("lag", "in_time"), [(9, True), (10, False)])
def test_an_effort_may_answer_a_state_as_old_as_the_watchdog_waits(
    lag: int, in_time: bool
) -> None:
    """The answer to a state arrives a period later, so a lag of nine is an age of
    ten."""
    receiver, robot = Link(7), watched(LiveSettings(watchdog=10))
    link = Link(7, peer=receiver.address)
    tau = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    states: list[int] = []

    def pilot() -> str | None:
        states.extend(packet.sequence for packet in receiver.receive(0.0))
        if states:
            receiver.newest = max(states[-1] - lag, 0)
            receiver.send(PacketKind.EFFORT, tau)
        return "enough" if len(states) > 60 else None

    served = serve(robot, link, stop_reason=pilot)
    assert (served.outdated == 0) == in_time
    receiver.close()
    link.close()


@pytest.mark.slow
def test_a_robot_without_a_client_or_parent_ends() -> None:
    hardware = UdpHardware(panda(), PERIOD)
    link = Link(hardware.session, peer=hardware.address)
    robot = watched()
    serve(robot, link, stop_reason=lambda: None, start_timeout=0.05)
    serve(robot, link, stop_reason=lambda: "gone")
    assert robot.phase is Phase.WAITING
    periods = iter(range(100_000))

    def dies() -> str | None:
        k = next(periods)
        if k < 20 and hardware.read(0.0) is not None:
            hardware.write(np.zeros(7))
        return "its parent is gone" if k == 30 else None

    serve(robot, link, stop_reason=dies)
    assert robot.reason == "its parent is gone"
    assert robot.phase is Phase.HOLDING
    hardware.close()
    hardware.drain()
    link.close()


def test_a_turn_ends_when_the_other_end_says_bye() -> None:
    """Despite lost packets, and messages from other senders."""
    here, there = Link(7), Link(7, peer=None, faults=Faults(lost=1.0))
    stranger = Link(7, peer=here.address)
    there.peer = here.address
    here.peer = there.address
    there.send(PacketKind.STATE, np.ones(2))
    stranger.end_turn()
    assert here.turn(0.05) is None
    there.end_turn()
    there.send(PacketKind.BYE)
    assert here.turn(60.0) == []  # the state was lost; the BYE is of the next one
    there.end_turn()
    assert [each.kind for each in here.turn(60.0) or []] == [PacketKind.BYE]
    there.end_turn()
    assert here.receive(0.0) == []
    assert here.counts["corrupted"] == 1  # from another sender
    for link in (here, there, stranger):
        link.close()
    assert here.turn(0.0) is None


@pytest.mark.slow
def test_in_lockstep_a_robot_waits_for_the_loop_and_a_loop_for_the_robot() -> None:
    lives = [True]
    hardware = UdpHardware(panda(), PERIOD, alive=lambda: lives[0])
    robot = watched(LiveSettings(watchdog=1))
    link = Link(hardware.session, peer=hardware.address)
    tau = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    reads = 0

    def loop() -> None:
        nonlocal reads
        while hardware.read(60.0) is None:
            pass
        for k in range(30):
            time.sleep(0.01 * (k == 10))  # late, with a watchdog of 2 ms
            hardware.write(tau)
            assert hardware.read(0.0) is not None
            reads += 1
        hardware.close()

    thread = threading.Thread(target=loop)
    thread.start()
    serve(robot, link, stop_reason=lambda: None, lockstep=True)
    thread.join(60.0)
    assert (robot.reason, reads) == (CLOSED_BY_LOOP, 30)
    assert link.counts["accepted"] == 30 + 3
    lives[0] = False
    while hardware.read(0.0) is not None:  # sent during its stop
        pass
    hardware.drain()
    link.close()


def test_in_lockstep_a_robot_whose_loop_is_silent_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It waits for an answer once, not in every period of its stop."""
    hardware = UdpHardware(panda(), PERIOD, alive=lambda: True)
    robot = watched()
    link = Link(hardware.session, peer=hardware.address)
    link.send(PacketKind.STATE, np.zeros(14))
    assert hardware.read(60.0) is not None
    hardware.write(np.zeros(7))
    turn, waited = link.turn, list[str]()

    def noted(timeout: float) -> list[Packet] | None:
        waited.append(robot.reason)
        return turn(timeout)

    monkeypatch.setattr(link, "turn", noted)
    serve(robot, link, stop_reason=lambda: None, start_timeout=0.3, lockstep=True)
    assert robot.reason == "the loop did not answer for 0.3 s"
    assert not any(waited)
    hardware.drain()
    link.close()


def test_a_stalled_robot_reports_the_duration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, periods = [0.0], iter(range(1000))
    monkeypatch.setattr(udp, "monotonic", lambda: now[0])
    monkeypatch.setattr(udp, "sleep", lambda s: now.append(now.pop() + s))

    def pilot() -> str | None:
        k = next(periods)
        now[0] += 0.3 * (k in {5, 9})
        return "enough" if k == 20 else None

    hardware = UdpHardware(panda(), PERIOD)
    link = Link(hardware.session, peer=hardware.address)
    served = serve(watched(), link, stop_reason=pilot)
    assert served.overrun == pytest.approx(2 * (0.3 - PERIOD))
    hardware.close()
    hardware.drain()
    link.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("raised", "source"),
    covering(
        [OddError, MemoryError, SystemExit, GeneratorExit], ["row", "receive", "send"]
    ),
)
def test_any_exception_around_a_served_robot_stops_it(
    source: str, raised: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors of cameras, log or line: it brakes, holds, and then ends."""
    hardware = UdpHardware(panda(), PERIOD)
    robot = watched()
    link = Link(hardware.session, peer=hardware.address)
    tau = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    rows: list[float] = []

    def pilot() -> None:
        if hardware.read(0.0) is not None:
            hardware.write(tau)

    def row(t: float, *_: object) -> None:
        rows.append(t)
        if len(rows) == 20 and source != "row":
            monkeypatch.setattr(link, source, fails)
        if len(rows) == 20 and source == "row":
            raise raised("why")

    def fails(*_: object, **__: object) -> None:
        raise raised("why")

    after: list[float] = []
    reported = [row, lambda t, *_: after.append(t)]
    serve(robot, link, stop_reason=pilot, on_rows=reported)  # type: ignore[arg-type]
    assert robot.reason.endswith(f": {raised.__name__}: why")
    assert robot.done
    if source == "row":
        assert (len(rows), len(after)) == (20, 19)
    hardware.close()
    hardware.drain()
    link.close()


def test_our_returned_packets_are_foreign() -> None:
    """A mirroring switch or a second socket: states are still accepted."""
    robot = Link(7, receives=PacketKind.EFFORT)
    loop = Link(7, peer=robot.address, receives=PacketKind.STATE)
    robot.peer = loop.address
    for k in range(5):
        for _ in range(3):  # the loop is ahead of the robot in its numbers
            loop.send(PacketKind.EFFORT, np.zeros(7))
        reflected = [encode(each) for each in robot.receive(0.1)]
        for data in reflected:
            robot._socket.sendto(data, loop.address)
        robot.send(PacketKind.STATE, np.full(14, float(k)))
        found = loop.receive(0.5)
        while not found:
            found = loop.receive(0.5)
        assert [each.payload[0] for each in found] == [float(k)]
    assert loop.counts["foreign"] == 15
    loop.send(PacketKind.BYE)
    (bye,) = [each for each in robot.receive(0.5) if each.kind is PacketKind.BYE]
    robot._socket.sendto(encode(bye), loop.address)
    robot.send(PacketKind.BYE)
    kinds = [each.kind for each in loop.receive(0.5)]
    assert kinds == [PacketKind.BYE]
    for link in (loop, robot):
        link.close()


def test_late_packets_are_sent_once_before_the_end() -> None:
    """There are several packets of the end, as one may be lost."""
    injector = FaultInjector(Faults(late=1.0))
    assert injector.apply(b"late") == []
    assert [injector.flush() for _ in range(3)] == [[b"late"], [], []]
