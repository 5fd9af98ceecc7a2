"""Writes a play as one page, in a separate process: the play continues meanwhile."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path


class OnePage:
    """The page of a play's log; see `hsp export`."""

    def __init__(self, save: Callable[[], Path], page: Path) -> None:
        """Begin without a page; ``save`` writes the log and returns its path."""
        self._save, self.path = save, page
        self._process: subprocess.Popen[str] | None = None

    def begin(self) -> str:
        """Save the log and begin to write its page; return a message for the user."""
        if self._process is None:
            command = ["export", str(self._save()), "--html", str(self.path)]
            self._process = subprocess.Popen(
                [sys.executable, "-m", "hsp_control", *command],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,  # Ctrl-C ends the play, and not the page
            )
        return f"writing {self.path} …"

    def done(self) -> str:
        """Return a message once it is written, or has failed; else None."""
        if self._process is None or self._process.poll() is None:
            return ""
        process, self._process = self._process, None
        assert process.stderr is not None
        with process.stderr as stream:
            words = stream.read().strip()
        return f"saved: {self.path}" if process.returncode == 0 else words

    def close(self) -> None:
        """Wait until it is written."""
        if self._process is not None:
            self._process.wait()
            self.done()
