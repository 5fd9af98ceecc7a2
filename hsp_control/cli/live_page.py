"""The process of a live loop's page: ``python -m hsp_control.cli.live_page``.

It draws what the loop writes into its journal, and passes on what the page says. It
reads its settings from its standard input, one line of JSON, and writes the page's
address. It begins to draw after a second line, ``begin``: until then the loop's process
compiles what both need. When its input is closed, the loop has ended, and so does it.
"""

import json
import os
import select
import signal
import socket
import sys
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from hsp_control.common.exceptions import HspControlError
from hsp_control.config import load_experiment
from hsp_control.play.channel import Channel
from hsp_control.play.mirror import Mirror
from hsp_control.play.picture import FRAME, Picture
from hsp_control.visualization.viewer import Viewer
from hsp_control.visualization.viewer.commands import set_caption, set_status
from hsp_control.visualization.viewer.server import Server

_POLL = 0.005
"""Time between two looks at what has come [s]."""
_NICENESS = 5
"""The loop comes first where processes are many."""
_RATE_WINDOW = 1.0
"""Time over which the loop's rate is measured [s]."""


def main() -> int:
    """Show the loop until it has ended; return 0, or 2 after one error message."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C stops the loop only
    os.nice(_NICENESS)
    try:
        if line := sys.stdin.readline():  # else the loop ended at once
            _run(json.loads(line))
    except HspControlError as error:
        print(f"hsp: the loop's page: {error}", file=sys.stderr)
        return 2
    return 0


def _run(settings: dict[str, Any]) -> None:
    server = Server(settings["port"], host=settings["host"], steerable=True)
    try:
        print(server.url, flush=True)
        config = settings["config"]
        status = set_status("preparing the loop …")
        server.send([set_caption(str(config.get("title") or ""), []), status])
        if sys.stdin.readline().strip() != "begin":
            return
        experiment = load_experiment(config)
        view = experiment.scenario.view.all_fields()
        viewer = Viewer(experiment.robot, transport=server, **view)
        channel = Channel(socket.socket(fileno=settings["channel"]))
        mirror = Mirror(
            experiment,
            settings["period"],
            Path(settings["journal"]),
            channel,
            held=settings["held"],
        )
        _show(mirror, Picture(mirror, viewer), server)
    finally:
        server.close()


def _show(mirror: Mirror, picture: Picture, server: Server) -> None:
    due = marked = monotonic()
    marked_at, rate, ended = mirror.t, 0.0, False
    while not ended:
        ended = _ended()  # then once more: the last row is drawn
        for message in server.messages():
            mirror.say(message)
        mirror.read()
        now = monotonic()
        if now - marked >= _RATE_WINDOW:
            rate = (mirror.t - marked_at) / (now - marked)
            marked, marked_at = now, mirror.t
        if now >= due or ended:
            picture.draw(running=not mirror.over, rate=rate)
            due = now + FRAME
        sleep(_POLL)


def _ended() -> bool:
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(ready) and not os.read(sys.stdin.fileno(), 4096)


if __name__ == "__main__":
    sys.exit(main())
