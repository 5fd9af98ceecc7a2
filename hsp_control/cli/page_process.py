"""Run a live loop's page in a process of its own, which always ends."""

import json
import select
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from hsp_control.cli.live_experiment import live_period
from hsp_control.common.exceptions import ViewerError
from hsp_control.config import Experiment
from hsp_control.config.scenario import Scenario
from hsp_control.config.streams import without_sources
from hsp_control.declaration.plain_data import plain_data
from hsp_control.play.channel import channel_pair

START = 60.0
"""Time in which the page's process must say its address [s]."""


class PageProcess:
    """The process of a page that shows and steers a live loop; a context manager."""

    def __init__(self, *, port: int | None, host: str, held: bool) -> None:
        """Prepare the process; entering the context starts it."""
        self.held = held  # whether somebody must hold a key
        self.channel, self._there = channel_pair()  # way to it
        self.url = ""  # page's address, with its key
        self._settings = {
            "channel": self._there.fileno(),
            "port": port,
            "host": host,
            "held": held,
        }

    def __enter__(self) -> Self:
        """Start the process, and wait for the page's address."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hsp_control.cli.live_page"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[self._there.fileno()],
            start_new_session=True,  # Ctrl-C reaches the loop only
        )
        self._there.close()
        assert self._process.stdout is not None
        self._say(self._settings)
        ready, _, _ = select.select([self._process.stdout], [], [], START)
        if not ready:
            self._process.kill()
            self.close()
            raise ViewerError(f"the loop's page did not start within {START:g} s")
        self.url = self._process.stdout.readline().decode().strip()
        if not self.url:
            self.close()
            raise ViewerError("the loop's page did not start")
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def prepare(self, scenario: Scenario) -> None:
        """Let it draw the robot and the scene of a configuration."""
        config = plain_data(scenario, defaults=True)
        self._say({"prepare": without_sources(config)})

    def say(self, text: str) -> None:
        """Set its status line."""
        self._say({"status": text})

    def begin(self, experiment: Experiment, journal: Path) -> None:
        """Let it draw the loop: what it needs is compiled."""
        journal.unlink(missing_ok=True)  # of another run
        self._say(
            {
                "begin": without_sources(experiment.config),
                "journal": str(journal.absolute()),
                "period": live_period(experiment),
            }
        )

    def close(self) -> None:
        """End the process; a second call does nothing."""
        self.channel.close()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _say(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # it has ended, and said why
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
