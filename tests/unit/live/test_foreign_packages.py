"""What packages of others raise where they connect a robot, or publish its states."""

import inspect
from typing import Any

import pytest

from hsp_control.cli import live
from hsp_control.common.errors import HardwareError
from hsp_control.live import connect, hardware, publish


class Broken:
    """An entry point whose package raises."""

    def load(self) -> Any:
        def make(*_: object) -> None:
            raise RuntimeError("no cable")

        return make


@pytest.mark.parametrize("use", [connect, publish])
def test_an_error_of_a_package_names_the_option(
    use: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hardware, "entry_points", lambda _: {"evil": Broken()})
    option = "--robot" if use is connect else "--publish"
    others = [None] * (len(inspect.signature(use).parameters) - 1)
    with pytest.raises(HardwareError) as raised:
        use("evil://there", *others)
    assert str(raised.value) == f"{option} 'evil://there': RuntimeError: no cable"


@pytest.mark.parametrize("error", [RuntimeError("lost"), SystemExit(0)], ids=repr)
def test_an_end_that_cannot_be_published_hides_no_report(
    error: BaseException, capsys: pytest.CaptureFixture[str]
) -> None:
    class Publisher:
        def __call__(self, t: float) -> None: ...

        def ended(self, ended: str, reason: str) -> None:
            raise error

    report: Any = type("Report", (), {"ended": "completed", "reason": "over"})
    live._publish_end(Publisher(), report)
    assert "the end was not published: " in capsys.readouterr().err
