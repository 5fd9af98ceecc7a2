"""What a terminal shows while kernels are compiled."""

import io
from contextlib import nullcontext

import pytest
from rich.console import Console
from rich.progress import Progress

from hsp_control.cli.compiling import compiling_shown
from hsp_control.common import kernels


def shown(terminal: bool, bar: bool = False) -> str:
    """Return what is printed while three kernels are compiled."""
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=100)
    with (
        compiling_shown(console),
        Progress(console=console) if bar else nullcontext(),
    ):
        for _ in range(3):
            assert kernels._watched(lambda: "code") == "code"
    assert kernels._watched(lambda: "code") == "code"  # and no longer
    return text.getvalue()


def test_a_terminal_counts_them() -> None:
    text = shown(terminal=True)
    assert "Compiling kernels (once" in text
    assert "2 done" in text
    assert "3 done" not in text


def test_a_file_and_a_progress_bar_are_left_alone() -> None:
    assert "Compiling" not in shown(terminal=False)
    shown(terminal=True, bar=True)


def test_a_failure_is_passed_on() -> None:
    def fails() -> None:
        raise ZeroDivisionError

    with (
        pytest.raises(ZeroDivisionError),
        compiling_shown(Console(file=io.StringIO(), force_terminal=True)),
    ):
        kernels._watched(fails)
