"""`hsp play` in another process, for tests of its pages."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any


def wait_until(condition: Callable[[], Any], timeout: float = 60.0) -> None:
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.02)


class Played:
    """A process of `hsp play`, and the address that it prints."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hsp_control", "play", "--no-browser", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert self.process.stdout is not None
        self.lines: list[str] = []
        for line in self.process.stdout:
            self.lines.append(line)
            if found := re.match(r"Play: (http\S+)", line):
                self.url = found[1]
                break

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def end(self, sign: signal.Signals = signal.SIGINT) -> str:
        self.process.send_signal(sign)
        out, _ = self.process.communicate(timeout=60.0)
        return "".join(self.lines) + str(out)
