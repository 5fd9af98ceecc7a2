"""Watch a user's own loop: the process of the page, which follows a journal."""

import json
import os
import select
import signal
import sys
from contextlib import suppress
from io import FileIO
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError
from hsp_control.companions.viewer.commands import set_status
from hsp_control.companions.viewer.live_picture import FRAME, Picture
from hsp_control.companions.viewer.pages import draw_empty
from hsp_control.companions.viewer.replay import rebuild_run
from hsp_control.companions.viewer.transport import PageServer
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.simulation import Rollout
from hsp_control.simulation.journal import JournalReader

_input = FileIO(0, closefd=False)  # standard input; nothing waits in a buffer
_NICENESS = 10  # the loop has priority
_POLL = 0.01
_KEPT = 1000  # rows that are kept for the picture
_STILL = 0.5  # time without a row after which the loop is reported as idle [s]
_RATE_WINDOW = 1.0  # time over which the rate is measured [s]


class Untouched:
    """No handles: a watched loop is only shown."""

    def __init__(self) -> None:
        self.targets: dict[str, Any] = {}
        self.obstacles: dict[str, Any] = {}
        self.knobs: dict[str, Any] = {}
        self.settings: dict[str, float | bool] = {}
        self.message, self.warning = "", False

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return where the targets and the obstacles are: there are none."""
        return {}, {}


class Watched:
    """The data of a watched loop for a picture, from its journal; see `Shown`."""

    kind = "watched"
    pushes = None
    laws: tuple[str, ...] = ()
    other = None
    previews = False

    def __init__(self, reader: JournalReader) -> None:
        """Begin with a reader that has the first row."""
        self.recorder, self.handles, self.over = reader, Untouched(), ""
        first = Rollout(reader.rows(0), reader.meta)
        run = rebuild_run(first, "the watched loop")
        self.robot, self.controller = run.robot, run.controller
        self.title = self.robot.name
        if self.controller is None:
            self.handles.message = "a user-defined type: its distances are plotted only"
        self._move()

    @property
    def meta(self) -> dict[str, Any]:
        """The meta data of the log so far."""
        return self.recorder.meta

    @property
    def t(self) -> float:
        """The time of the last row [s]."""
        return float(self._last()["t"][0])

    def pull(self) -> tuple[Array, Array, float] | None:
        """Return None: links of a watched loop cannot be pulled."""
        return None

    def read(self) -> bool:
        """Read the new part of the journal; return whether there is a new row."""
        if not self.recorder.read():
            return False
        self._move()
        return True

    def _last(self) -> dict[str, Array]:
        return self.recorder.rows(self.recorder.count - 1)

    def _move(self) -> None:
        """Move the controller, whose field and distances are drawn, to the last row."""
        if self.controller is not None:
            row = self._last()
            with suppress(HspControlError):  # the loop reports it
                self.controller.compute(float(row["t"][0]), row["q"][0], row["v"][0])


def main() -> int:
    """Show a journal while it grows; return 0, or 2 after one error message.

    It reads lines of JSON from its standard input. The first has its settings; then it
    writes the page's address. A later one names another journal. It ends when its input
    is closed, since the loop's program has ended then.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C stops the loop only
    os.nice(_NICENESS)
    try:
        if line := _input.readline():
            _show(json.loads(line))
    except HspControlError as error:
        print(f"hsp: the page of the watched loop: {error}", file=sys.stderr)
        return 2
    return 0


def _show(settings: dict[str, Any]) -> None:
    server = PageServer(settings["port"], host=settings["host"])
    try:
        print(server.url, flush=True)
        draw_empty(server, "")
        server.send([set_status("waiting for the loop's first step …")])
        journal: Path | None = Path(settings["journal"])
        while journal is not None:
            journal = _follow(server, journal, settings["view"])
    finally:
        server.close()


def _follow(server: PageServer, journal: Path, view: dict[str, Any]) -> Path | None:
    """Show a journal until there is another one; None: the program has ended."""
    reader = JournalReader(journal, most=_KEPT)
    while not reader.read():
        if word := _word():
            return word.path
        sleep(5.0 * _POLL)
    watched = Watched(reader)
    viewer = Viewer(watched.robot, transport=server, **view)
    picture = Picture(watched, viewer)
    server.send([set_status("")])
    due = marked = seen = monotonic()
    marked_at, rate = watched.t, 0.0
    while True:
        word = _word()
        new, now = watched.read(), monotonic()
        seen = now if new else seen
        if now - marked >= _RATE_WINDOW:
            rate = (watched.t - marked_at) / (now - marked)
            marked, marked_at = now, watched.t
        if word or reader.ended:
            watched.over = str(reader.meta.get("message", "")) or "the loop has ended"
        if now >= due or word:
            picture.draw(running=now - seen < _STILL and not watched.over, rate=rate)
            due = now + FRAME
        if word:
            return word.path
        sleep(_POLL)


class _Word:
    """A message of the loop's process: another journal, or the end."""

    def __init__(self, path: Path | None) -> None:
        self.path = path


def _word() -> _Word | None:
    ready, _, _ = select.select([_input], [], [], 0.0)
    if not ready:
        return None
    line = _input.readline()
    return _Word(Path(json.loads(line)["journal"]) if line else None)


if __name__ == "__main__":
    sys.exit(main())
