"""What a terminal shows while kernels are compiled."""

import gc
import io
from contextlib import nullcontext

import pytest
from rich.console import Console
from rich.progress import Progress

from hsp_control.cli.consoles import compiling_shown, compiling_told
from hsp_control.common import kernels

HIDE = "\x1b[?25l"
"""What a terminal gets when a line that changes begins: its cursor is hidden."""


def shown(terminal: bool, bar: bool = False) -> str:
    """Return what is printed while three kernels are compiled."""
    text = io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=100)
    with compiling_shown(console), Progress(console=console) if bar else nullcontext():
        for _ in range(3):
            assert kernels._watched(lambda: "code") == "code"
    assert kernels._watched(lambda: "code") == "code"  # and no longer
    return text.getvalue()


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


def test_no_garbage_is_collected_while_a_kernel_is_compiled() -> None:
    assert gc.isenabled()
    assert not kernels._watched(lambda: kernels._watched(gc.isenabled))
    assert gc.isenabled()
    gc.disable()
    try:
        kernels._watched(lambda: None)
        assert not gc.isenabled()  # as it was
    finally:
        gc.enable()


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
