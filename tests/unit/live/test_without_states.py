"""Periods without a state: the waiting time, and the prediction in between."""

import numpy as np
import pytest
from live_rigs import PERIOD, Rig, law, missing, start, watched
from loaded_robots import panda

from hsp_control.common.arrays import Array
from hsp_control.live import LiveSettings, Measurement, StopSettings, run_loop
from hsp_control.live.state_reader import StateReader


class Silent:
    """Hardware with a clock that sends states until it is stopped.

    Attributes:
        now: Its clock [s].
        still: Whether it sends nothing.
        waits: Timeouts of all `read` calls [s].
    """

    period = PERIOD

    def __init__(self, v: Array) -> None:
        self.now, self.still, self.waits = 0.0, False, list[float]()
        self._q, self._v, self._sequence = start(), v, 0

    def read(self, timeout: float) -> Measurement | None:
        self.waits.append(timeout)
        if self.still:
            self.now += timeout
            return None
        self.now += PERIOD
        self._sequence += 1
        q = self._q + self._sequence * PERIOD * self._v
        return Measurement(self._sequence, self._sequence * PERIOD, q, self._v.copy())

    def write(self, effort: Array) -> None:
        """Ignore the effort."""

    def close(self) -> None:
        """Do nothing."""


def reader_of(hardware: Silent) -> StateReader:
    """Return a reader that has read twenty states."""
    reader = StateReader(
        panda(), None, hardware, LiveSettings(missing=50), lambda: hardware.now
    )
    reader.wait_for_first()
    reader.start()
    effort = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    for _ in range(20):
        reader.read(effort, None)
        reader.effort_sent(effort)
        assert reader.fault is None
    return reader


def test_after_a_stall_each_missing_state_is_waited_for_as_before() -> None:
    """Otherwise the tolerated number of missing states would pass at once."""
    hardware = Silent(np.zeros(7))
    reader = reader_of(hardware)
    hardware.still = True
    hardware.now += 0.03  # this process was not scheduled
    hardware.waits.clear()
    for _ in range(10):
        reader.read(np.zeros(7), None)
    np.testing.assert_allclose(hardware.waits[2:], PERIOD, rtol=1e-9)


def test_the_speed_of_a_silent_robot_is_that_of_the_model() -> None:
    v = np.full(7, 0.01)
    hardware = Silent(v)
    reader = reader_of(hardware)
    assert reader.speed == pytest.approx(0.01, rel=1e-6)
    hardware.still = True
    pushes = panda().inverse_dynamics(start(), v, np.full(7, 20.0))
    for _ in range(20):
        reader.read(pushes, None)
    assert reader.speed == np.abs(reader.state.v).max()
    assert reader.speed == pytest.approx(0.01 + 20 * PERIOD * 20.0, rel=0.2)


def test_predictions_before_a_late_state_are_discarded() -> None:
    """Every second state is lost, ten times as many as may be lost in a row."""
    lost = dict.fromkeys(range(41, 20_000, 2), missing)
    settings = LiveSettings(prediction_time=0.02, stop=StopSettings(hold=0.2))
    report = run_loop(law(), Rig(watched(), lost), duration=0.1, settings=settings)
    assert report.ended == "completed", report.reason
    assert not report.silent


def test_an_effort_is_held_for_ten_milliseconds_then_the_robot_brakes() -> None:
    """The mean of ten; until states arrive again, and then the law goes on."""
    lost, held = 18, 10
    rig = Rig(watched(), dict.fromkeys(range(80, 80 + lost), missing))
    speeds = list[float]()
    report = run_loop(
        law(),
        rig,
        duration=0.2,
        on_period=lambda _: speeds.append(float(np.abs(rig.robot.v).max())),
    )
    assert report.ended == "completed", report.reason
    sent = np.array(rig.sent)
    changes = np.abs(np.diff(sent, axis=0)).max(axis=1)
    still = np.flatnonzero(changes[:150] == 0.0)
    assert still.size == held - 1
    assert np.ptp(still) == held - 2
    first = int(still[0])
    mean = sent[first - held : first].mean(axis=0)
    np.testing.assert_allclose(sent[first], mean, rtol=1e-12)
    begin = int(still[-1]) + 2  # of braking
    end = begin + lost - held
    expected = np.exp(-StopSettings().damping * (lost - held) * PERIOD)
    assert speeds[end] / speeds[begin] == pytest.approx(expected, rel=0.02)
    assert speeds[-1] > speeds[end]


def test_braking_begins_anew_when_states_are_missing_again() -> None:
    """Otherwise the robot is pulled back to where it was held some time before."""
    stop, lost, held = StopSettings(longest_damping=0.01), 30, 10
    gaps = (100, 250)
    reads = [read for begin in gaps for read in range(begin, begin + lost)]
    rig, v = Rig(watched(), dict.fromkeys(reads, missing)), list[Array]()
    settings = LiveSettings(missing=50, stop=stop)
    report = run_loop(
        law(),
        rig,
        duration=0.35,
        settings=settings,
        on_period=lambda _: v.append(rig.robot.v.copy()),
    )
    assert report.ended == "completed", report.reason
    left = np.exp(-stop.damping * 8 * PERIOD)
    for begin in (gap + held for gap in gaps):  # damped for ten periods, then held
        assert np.abs(v[begin]).max() > 0.5
        # Of predicted states: 0.02 rad/s off; a pull back makes 0.1 in the second gap.
        np.testing.assert_allclose(v[begin + 8], left * v[begin], rtol=0, atol=0.04)


def test_an_effort_is_held_over_two_lost_states_of_a_long_period() -> None:
    """At 10 ms, too: often two of them are lost in a row on a bad line."""
    lost = {read for read in range(10, 90) if read % 10 < 2}
    rig = Rig(watched(period=0.01), dict.fromkeys(lost, missing))
    report = run_loop(law(), rig, duration=1.0)
    assert report.ended == "completed", report.reason
    held = np.flatnonzero((np.diff(rig.sent, axis=0) == 0.0).all(axis=1)) + 3
    assert lost == {read for read in held.tolist() if read < 90}
