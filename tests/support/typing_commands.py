"""Runs ``hsp`` commands as a user would, in separate processes."""

import io
import os
import signal
import subprocess
import sys
import time
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

import psutil
from ready_commands import ReadyCommands

from hsp_control.cli import main

READY = ReadyCommands()


def hsp(line: str, folder: Path, status: int = 0) -> str:
    """Run a command in a folder, and return its output; Ctrl-C ends a play."""
    if line.startswith("play "):
        return played([sys.executable, "-m", "hsp_control", *line.split()], folder)
    found, printed = READY.run(line.split(), folder, without_display())
    assert found == status, f"hsp {line}\n{printed}"
    return printed


def script(name: str, folder: Path) -> str:
    """Run a script in a folder, and return its output."""
    found, printed = READY.run([name], folder, without_display())
    assert found == 0, f"python {name}\n{printed}"
    return printed


def played(command: list[str], folder: Path) -> str:
    """Start a play, and end it after it has computed for a while."""
    with subprocess.Popen(
        command, cwd=folder, text=True, env=without_display(),
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as play:  # fmt: skip
        assert play.stdout is not None
        begin = ""
        for line in play.stdout:
            begin += line
            if line.startswith("Ctrl-C ends it"):
                break
        begun = psutil.Process(play.pid)
        enough = begun.cpu_times().user + 0.3  # some rows; even one is a log
        while begun.is_running() and begun.cpu_times().user < enough:
            time.sleep(0.05)
        play.send_signal(signal.SIGINT)
        reported = begin + play.communicate(timeout=250)[0]
    assert play.returncode == 0, reported
    return reported


def without_display() -> dict[str, str]:
    """Return the environment of a command that can open no window."""
    hidden = {"DISPLAY", "WAYLAND_DISPLAY", "BROWSER"}
    return {key: value for key, value in os.environ.items() if key not in hidden}


def in_this_process(line: str, folder: Path, status: int = 0) -> str:
    """Run an `hsp` command in this process, since starting another takes a second.

    Start and exit of commands are tested in separate processes, once per command.
    """
    printed = io.StringIO()
    with chdir(folder), redirect_stdout(printed), redirect_stderr(printed):
        found = main(line.split())
    assert found == status, f"hsp {line}\n{printed.getvalue()}"
    return printed.getvalue()


def typed(command: list[str], folder: Path, status: int = 0) -> str:
    """Run a command in a folder without a display, and return its output."""
    done = subprocess.run(
        command, cwd=folder, text=True, check=False, timeout=250, env=without_display(),
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert done.returncode == status, f"{' '.join(command)}\n{done.stdout}"
    return done.stdout
