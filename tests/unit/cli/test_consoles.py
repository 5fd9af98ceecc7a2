"""What a terminal shows while a command works, and what a pipe does not get."""

import io

import pytest
from rich.console import Console

from hsp_control.cli import consoles
from hsp_control.cli.consoles import compiling_shown, compiling_told
from hsp_control.compiled import kernels


@pytest.mark.parametrize("terminal", [True, False])
def test_only_a_terminal_shows_what_is_being_done(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=80, color_system=None)
    monkeypatch.setattr(consoles, "errors", console)
    with consoles.working("Drawing [a]"):
        print("a result")
    assert ("Drawing [a] ... 0:00:00" in text.getvalue()) is terminal
    assert capsys.readouterr().out == "a result\n"  # a pipe gets it untouched


HIDE = "\x1b[?25l"
"""What a terminal gets when a line that changes begins: its cursor is hidden."""


def test_kernels_that_a_kernel_calls_are_counted() -> None:
    """The largest one takes half of the time: the number goes on within it."""
    said: list[str] = []

    def outer() -> None:
        for _ in range(3):
            kernels._watched(lambda: None)

    with compiling_told(said.append):
        kernels._watched(outer)
    assert [line.split(" ... ")[1] for line in said] == [
        f"{done} done" for done in (0, 0, 1, 1, 2, 2, 3, 4)
    ]
    text = io.StringIO()
    with compiling_shown(Console(file=text, force_terminal=True, width=100)):
        kernels._watched(outer)
        text.write("|")  # the line was taken away only after the last one
        kernels._watched(outer)
    assert text.getvalue().split("|")[0].count(HIDE) == 1


def test_a_failure_is_passed_on() -> None:
    def fails() -> None:
        raise ZeroDivisionError

    with (
        pytest.raises(ZeroDivisionError),
        compiling_shown(Console(file=io.StringIO(), force_terminal=True)),
    ):
        kernels._watched(fails)
