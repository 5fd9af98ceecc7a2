"""Progress that a terminal shows while a command works, and a pipe does not."""

import io

import pytest
from rich.console import Console

from hsp_control.cli import consoles


@pytest.mark.parametrize("terminal", [True, False])
def test_only_a_terminal_shows_progress(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=80, color_system=None)
    monkeypatch.setattr(consoles, "errors", console)
    with consoles.working("Drawing [a]"):
        print("a result")
    assert ("Drawing [a] ... 0:00:00" in text.getvalue()) is terminal
    assert capsys.readouterr().out == "a result\n"  # a pipe receives it unchanged
