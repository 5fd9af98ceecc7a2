"""A live loop whose stream's thread ends with an error."""

from asyncio import CancelledError
from threading import Event
from typing import Any

import pytest
from live_rigs import PERIOD, Rig, start, watched
from loaded_robots import panda
from odd_errors import NamelessError, OddError
from places import further

import hsp_control as hsp
from hsp_control.live import LoopReport, run_loop
from hsp_control.trajectories.streams import sources
from hsp_control.trajectories.streams import streamed as declared


class FailingKind:
    """A type of address whose thread raises as soon as the loop runs."""

    def __init__(self, error: BaseException | None) -> None:
        self.error, self.go, self.ended = error, Event(), Event()

    def check_address(self, source: str) -> None:
        """All addresses are valid."""

    def is_local(self, source: str) -> bool:
        return True

    def opened(self, source: str, space: Any) -> Any:
        def listen(inbox: Any) -> None:
            try:
                while not self.go.wait(0.01):
                    if inbox() is None:
                        return  # no longer in use, as after the warm-up
                if self.error is not None:
                    raise self.error
            finally:
                self.ended.set()

        return listen


def streamed(kind: FailingKind, monkeypatch: pytest.MonkeyPatch) -> hsp.Controller:
    for module in (sources, declared):
        monkeypatch.setattr(module, "kind_of", lambda source: kind)
    tip = panda().state(0.0, start(), 0.0 * start()).position("panda_tcp")
    task = hsp.FramePosition("panda_tcp", hsp.Stream(tip, source="mine://here"))
    return hsp.Controller(panda(), [task], hsp.TargetPosture(start()))


@pytest.mark.parametrize(
    "error",
    [
        NamelessError(),
        *further(CancelledError("x"), GeneratorExit(), OddError("panic")),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_exception_of_a_stream_s_thread_ends_in_the_safe_stop(
    error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:

    def run(error: BaseException | None) -> LoopReport:
        kind = FailingKind(error)

        def after_some(t: float) -> None:
            if t > 20 * PERIOD:
                kind.go.set()
                assert kind.ended.wait(60.0)
                sources._threads["mine://here"].join(60.0)

        controller, rig = streamed(kind, monkeypatch), Rig(watched())
        return run_loop(controller, rig, duration=0.1, on_period=after_some)

    report = run(error)
    assert report.ended == "fault"
    assert "mine://here: its thread has ended: " in report.reason
    assert type(error).__name__ in report.reason
    assert report.at_rest
    # The next run listens at the address again.
    assert run(None).ended == "completed"
