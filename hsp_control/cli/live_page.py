"""The process of a live loop's page: ``python -m hsp_control.cli.live_page``.

It draws what the loop writes into its journal, and passes on what the page says. It
reads lines of JSON from its standard input. The first has its settings; then it writes
the page's address. ``prepare`` lets it draw the robot and the scene, ``status`` sets
the status line, ``begin`` lets it draw the loop: until then the loop's process compiles
what both need. When its input is closed, the loop has ended, and so does it.
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

from hsp_control.cli.consoles import compiling_told
from hsp_control.cli.pages import draw_before, draw_empty, status_line
from hsp_control.common.exceptions import HspControlError
from hsp_control.config import load_experiment
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import LoadedScenario, load_scenario
from hsp_control.play.channel import Channel
from hsp_control.play.mirror import Mirror
from hsp_control.play.picture import FRAME, Picture
from hsp_control.visualization.viewer import Viewer
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
        draw_empty(server, "")
        say = status_line(server)
        say("preparing the loop …")
        viewer: Viewer | None = None
        for line in iter(sys.stdin.readline, ""):
            match json.loads(line):
                case {"status": str(text)}:
                    say(text)
                case {"prepare": dict(config)}:
                    viewer = _drawn(
                        load_scenario(Document(config, {}, "configuration")), server
                    )
                case {"begin": dict(config), "journal": str(file), "period": period}:
                    assert viewer is not None
                    with compiling_told(say):
                        experiment = load_experiment(config)
                        channel = Channel(socket.socket(fileno=settings["channel"]))
                        journal, held = Path(file), settings["held"]
                        mirror = Mirror(experiment, period, journal, channel, held=held)
                        picture = Picture(mirror, viewer)
                    _show(mirror, picture, server)
                    return
    finally:
        server.close()


def _drawn(loaded: LoadedScenario, server: Server) -> Viewer:
    viewer = Viewer(loaded.robot, transport=server, **loaded.scenario.view.all_fields())
    draw_before(viewer, loaded)
    return viewer


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
