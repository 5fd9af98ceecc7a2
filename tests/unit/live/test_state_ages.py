"""The age of a state, by two unsynchronised clocks."""

import numpy as np
import pytest
from live_rigs import PERIOD
from loaded_robots import panda

from hsp_control.common.arrays import Array
from hsp_control.live import Phase, udp
from hsp_control.live.link import AgeEstimator, Packet, PacketKind
from hsp_control.live.udp import UdpHardware

APART = 1234.5
"""Offset of the two clocks [s]."""


def ages_of(delays: Array, every: float = 0.1, window: float = 1.0) -> Array:
    """Return the ages of packets sent periodically with these delays [s]."""
    estimator = AgeEstimator(window)
    sent = every * np.arange(len(delays))
    return np.array(
        [
            estimator.age(t + delay, t + APART)
            for t, delay in zip(sent, delays, strict=True)
        ]
    )


def test_the_quickest_packet_has_no_age_and_others_are_older_than_it() -> None:
    delays = np.array([0.004, 0.003, 0.009, 0.003, 0.005])
    np.testing.assert_allclose(ages_of(delays), [0, 0, 0.006, 0, 0.002], atol=1e-9)


def test_a_fast_packet_is_used_through_the_next_window() -> None:
    """For at least one window, for any arrival time, and for at most two."""
    for quick in range(12):
        delays = np.full(60, 0.008)
        delays[quick] = 0.001
        ages = ages_of(delays)
        np.testing.assert_allclose(
            ages[quick : quick + 10], [0, *[0.007] * 9], atol=1e-9
        )
        np.testing.assert_allclose(ages[quick + 24 :], 0.0, atol=1e-9)


def test_ages_are_never_negative_and_know_no_offset() -> None:
    delays = np.random.default_rng(0).uniform(0.001, 0.02, 300)
    ages = ages_of(delays)
    assert ages.min() >= 0.0
    # at most the minimum of all, at least that of the last ten
    for k in range(10, 300):
        least = delays[: k + 1].min(), delays[k - 9 : k + 1].min()
        assert delays[k] - least[1] - 1e-9 <= ages[k] <= delays[k] - least[0] + 1e-9


def test_a_clock_that_drifts_is_followed() -> None:
    """With a drift of 1 ms/s the error stays below the drift in two windows."""
    estimator = AgeEstimator(1.0)
    ages = [estimator.age(0.1 * k + 1e-4 * k, 0.1 * k) for k in range(500)]
    assert max(ages) < 2.2e-3
    assert ages[-1] > 0.0


def test_states_of_a_robot_have_the_age_of_the_newest_packet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A packet that waited 30 ms longer than the fastest; all packets are used."""
    now, arrived = [100.0], list[Packet]()
    monkeypatch.setattr(udp, "monotonic", lambda: now[0])
    hardware = UdpHardware(panda(), PERIOD)
    monkeypatch.setattr(hardware.link, "receive", lambda timeout: arrived)
    payload = np.concatenate([panda().home(), np.zeros(7)])

    def state(k: int) -> Packet:
        stamp = round(1e9 * (10.0 + 0.01 * k))
        head = PacketKind.STATE, Phase.RUNNING, hardware.session, k, 0
        return Packet(*head, stamp, 3.0 * k, payload)

    def age(*numbers: int, delay: float) -> float:
        now[0] = 100.0 + 0.01 * numbers[-1] + delay
        arrived[:] = [state(k) for k in numbers]
        found = hardware.read(0.0)
        assert found is not None
        assert (found.sequence, found.t) == (numbers[-1], 3.0 * numbers[-1])
        return found.age

    try:
        assert age(0, delay=0.002) == pytest.approx(0.0, abs=1e-6)
        assert age(1, delay=0.032) == pytest.approx(0.03, abs=1e-6)
        # two arrive together: the later one is 10 ms younger
        assert age(2, 3, delay=0.012) == pytest.approx(0.01, abs=1e-6)
        assert age(4, delay=0.001) == pytest.approx(0.0, abs=1e-6)
        assert age(5, delay=0.002) == pytest.approx(0.001, abs=1e-6)
    finally:
        monkeypatch.undo()
        hardware.close()
        hardware.drain()


def test_a_robot_in_any_phase_of_its_stop_has_stopped_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hardware = UdpHardware(panda(), PERIOD)
    payload = np.concatenate([panda().home(), np.zeros(7)])
    try:
        for phase in Phase:
            head = PacketKind.STATE, phase, hardware.session, 1, 0
            packets = [Packet(*head, 0, 0.0, payload)]
            monkeypatch.setattr(hardware.link, "receive", lambda _, p=packets: p)
            found = hardware.read(0.0)
            assert found is not None
            assert found.halted == (phase in {Phase.DAMPING, Phase.HOLDING})
    finally:
        monkeypatch.undo()
        hardware.close()
        hardware.drain()
