"""Types commands of ``hsp`` as a user does, each in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

PATIENCE = "--set live.missing=2000 --set live.watchdog=2000 --set live.age=60"
"""What `hsp live` is given on a busy computer."""


def hsp(line: str, folder: Path, status: int = 0) -> str:
    """Type a command in a folder, and return what it prints; Ctrl-C ends a play."""
    command = [sys.executable, "-m", "hsp_control", *line.split()]
    if line.startswith("play "):
        command = ["timeout", "--preserve-status", "-s", "INT", "8", *command]
    return typed(command, folder, status)


def typed(command: list[str], folder: Path, status: int = 0) -> str:
    """Run a command in a folder without a display, and return what it prints."""
    hidden = {"DISPLAY", "WAYLAND_DISPLAY", "BROWSER"}
    done = subprocess.run(
        command, cwd=folder, text=True, check=False, timeout=250,
        env={key: value for key, value in os.environ.items() if key not in hidden},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert done.returncode == status, f"{' '.join(command)}\n{done.stdout}"
    return done.stdout
