"""``hsp view`` and ``hsp run --view`` as a user runs them, with or without a
browser."""

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest
from pages import Page

from hsp_control import Rollout
from hsp_control.cli import main
from hsp_control.companions.viewer import pages as pages_of_commands
from hsp_control.companions.viewer import transport

MOVING = "paper/4_moving_obstacle"
SHORT = ["--set", "simulation.duration=0.2"]


@pytest.fixture(autouse=True)
def nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(transport.sys, "platform", "linux")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    assert main(["run", MOVING, "--out", str(folder), *SHORT]) == 0
    return next(folder.glob("*.npz"))


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def address(printed: str) -> str:
    (line,) = [line for line in printed.splitlines() if line.startswith("View: ")]
    return line.removeprefix("View: ").strip()


def ended(url: str) -> bool:
    """Return whether no page is served; another server may use the port by now."""
    try:
        urlopen(url).close()
    except URLError:  # no server, or one without this key
        return True
    return False


@pytest.mark.process
def test_view_prints_its_address_and_keeps_no_script_waiting(
    log: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pages_of_commands, "PAGE_TIMEOUT", 1e5)  # endless
    assert main(["view", str(log)]) == 0
    url = address(capsys.readouterr().out)
    assert ended(url)  # no files remain
    assert f"the view is at {url}" in caplog.text
    caplog.clear()
    assert main(["view", "--no-browser", str(log), str(log), "--beside"]) == 0
    assert not caplog.records


@pytest.mark.process
@pytest.mark.smoke
def test_run_shows_its_progress_and_keeps_its_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", MOVING, "--view", "--out", str(tmp_path), *SHORT]) == 0
    assert ended(address(capsys.readouterr().out))
    assert len(Rollout.load(next(tmp_path.glob("*.npz")))) == 21


@pytest.mark.process
def test_the_page_of_a_run_opens_once_and_shows_its_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "RELOAD_TIMEOUT", 0.5)
    # A run may be over before a page has connected: it waits for the page then.
    monkeypatch.setattr(pages_of_commands, "PAGE_TIMEOUT", 200.0)
    opened: list[Page] = []

    def look(url: str) -> bool:
        opened.append(Page(url))
        threading.Thread(target=leave_after_the_run, args=opened, daemon=True).start()
        return True

    def leave_after_the_run(page: Page) -> None:
        while not any(c["type"] == "ask" for c in list(page.commands)):
            time.sleep(0.05)
        time.sleep(0.5)
        page.leave()

    monkeypatch.setattr(transport, "open_browser", look)
    assert main(["run", MOVING, "--view", "--out", str(tmp_path), *SHORT]) == 0
    (page,) = opened
    assert page.last("caption", "/caption")["title"]
    assert page.last("set_object", "/robot/joint3/link3")
    assert page.last("clip", "/clip")


def test_a_port_without_a_page_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path)]
    assert main(["run", MOVING, "--port", "7007", *out, *SHORT]) == 2
    assert "--port is that of a page: it needs --view" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


@pytest.mark.process
def test_a_port_in_use_is_reported_and_the_run_continues(
    tmp_path: Path, log: Path, taken: int, capsys: pytest.CaptureFixture[str]
) -> None:
    port = ["--port", str(taken)]
    assert main(["view", str(log), *port]) == 2
    message = f"cannot listen on 127.0.0.1:{taken}: Address already in use"
    assert message in capsys.readouterr().err
    out = ["--out", str(tmp_path)]
    assert main(["run", MOVING, "--view", *port, *out, *SHORT]) == 2
    captured = capsys.readouterr()
    assert f"{message}; the run continues without a view" in captured.err
    assert "completed" in captured.out
    assert len(Rollout.load(next(tmp_path.glob("*.npz")))) == 21


def test_nonsensical_input_is_refused(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(log), "--speed", "0"]) == 2
    assert "speed is 0.0; must be positive" in capsys.readouterr().err
    assert main(["view", str(log).replace("obstacle", "obstacel")]) == 2
    assert f"did you mean '{log}'" in capsys.readouterr().err


@pytest.mark.process
def test_with_a_browser_it_stays_until_the_page_is_closed(
    log: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(transport, "RELOAD_TIMEOUT", 0.5)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setenv("DISPLAY", ":0")
    graphical = transport.webbrowser.BackgroundBrowser("firefox")
    monkeypatch.setattr(transport.webbrowser, "get", lambda: graphical)
    pages: list[Page] = []
    left: list[float] = []

    def look(url: str, new: int) -> None:
        leads = Path(url.removeprefix("file://")).read_text()
        address = leads.partition("url=")[2].partition('"')[0]
        page = Page(address)
        pages.append(page)
        time.sleep(1.5)
        left.append(time.monotonic())
        page.leave()

    monkeypatch.setattr(transport.webbrowser, "open", look)
    assert main(["view", str(log)]) == 0
    assert time.monotonic() > left[0]  # not before the page is closed
    (page,) = pages
    assert ("clip", "/clip") in [(c["type"], c.get("path")) for c in page.commands]
