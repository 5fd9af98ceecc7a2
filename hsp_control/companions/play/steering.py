"""``hsp live --steer``: a page that shows a live loop, and steers it; its process."""

import argparse
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple, Self

from hsp_control.cli.consoles import out
from hsp_control.cli.live_experiment import live_period
from hsp_control.cli.robot_process import end_process
from hsp_control.common.errors import HspControlError, ViewerError
from hsp_control.companions.play.handles import Handles
from hsp_control.companions.play.live_loop import (
    Channel,
    DeadMansKey,
    Mirror,
    SteeredLoop,
    channel_pair,
)
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.live_picture import FRAME, Picture
from hsp_control.companions.viewer.pages import (
    OpeningPage,
    draw_before,
    draw_empty,
    status_line,
)
from hsp_control.companions.viewer.transport import PageServer
from hsp_control.config import Experiment, Scenario, load_experiment
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import LoadedScenario, load_scenario
from hsp_control.config.streams import without_sources
from hsp_control.control.interface import Controller
from hsp_control.declaration.plain_data import plain_data
from hsp_control.live import OperatorRequests

START = 60.0  # time in which the page's process must report its address [s]


class PageProcess:
    """The process of a page that shows and steers a live loop; a context manager."""

    def __init__(self, *, port: int | None, host: str, held: bool) -> None:
        self.held = held  # whether a key must be held
        self.channel, self._there = channel_pair()  # queue to it
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
            [sys.executable, "-m", "hsp_control.companions.play.steering"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[self._there.fileno()],
            start_new_session=True,  # Ctrl-C reaches the loop only
        )
        self._there.close()
        try:
            self._wait_for_address()
        except BaseException:  # such as Ctrl-C: nothing else ends the process
            self._process.kill()
            self.close()
            raise
        return self

    def _wait_for_address(self) -> None:
        assert self._process.stdout is not None
        self._say(self._settings)
        ready, _, _ = select.select([self._process.stdout], [], [], START)
        if not ready:
            raise ViewerError(f"the loop's page did not start within {START:g} s")
        self.url = self._process.stdout.readline().decode().strip()
        if not self.url:
            raise ViewerError("the loop's page did not start")

    def __exit__(self, *_: object) -> None:
        self.close()

    def prepare(self, scenario: Scenario) -> None:
        """Request that it draws the robot and the scene of a configuration."""
        config = plain_data(scenario, defaults=True)
        self._say({"prepare": without_sources(config)})

    def say(self, text: str) -> None:
        """Set its status line."""
        self._say({"status": text})

    def begin(self, experiment: Experiment, journal: Path) -> None:
        """Request that it draws the loop, whose journal exists now."""
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
        end_process(self._process, 5.0)

    def _say(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # it has ended, and reported why
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()


_REHEARSAL = 0.5  # time of a rehearsal [s]: beyond the ramps of changes
_POLL = 0.02


class SteeringPage(NamedTuple):
    """A page that shows a live loop."""

    process: PageProcess
    opening: OpeningPage  # opens it

    def let_steer(
        self, experiment: Experiment, requests: OperatorRequests, journal: Path
    ) -> Callable[[float], object]:
        """Return the function that the loop calls every period for the page."""
        # With a dead-man's key it returns when the key is held for the first time, or
        # when the operator stops.
        controller, period = experiment.controller, live_period(experiment)
        controller.restart(origin=0.0)  # after the dry run
        controller.compute(0.0, experiment.q0, experiment.v0)
        _rehearse(controller, period, experiment)
        self.opening.open()
        page = self.process
        page.begin(experiment, journal)
        key = DeadMansKey() if page.held else None
        loop = SteeredLoop(controller, period, page.channel, requests, key=key)
        if key is not None:
            out.print(
                "It begins when the key is held: the space bar, or the page's button."
            )
            while not key.held and requests.reason is None:
                loop.listen()
                loop.send_state()
                sleep(_POLL)
            if page.channel.lost:
                raise ViewerError(
                    "the loop's page has ended before its key was held; the loop did "
                    "not begin"
                )
        return loop.on_period


@contextmanager
def steering_page(
    options: argparse.Namespace, scenario: Scenario
) -> Iterator[SteeringPage]:
    """Yield the page, which shows the robot and the scene."""
    # It opens when `let_steer` is called.
    held = options.steer == "hardware"
    with PageProcess(port=options.port, host=options.host, held=held) as process:
        process.prepare(scenario)
        opening = OpeningPage(
            process.url,
            options,
            lambda url: out.print(f"Steer: {url}", soft_wrap=True),
        )
        yield SteeringPage(process, opening)


def _rehearse(controller: Controller, period: float, experiment: Experiment) -> None:
    """Execute every command of a page with a copy, so that the loop does none first."""
    memo: dict[int, Any] = {id(controller.robot): controller.robot}
    copy = deepcopy(controller, memo)
    handles = Handles(copy, period)
    handles.rehearse()
    for k in range(round(_REHEARSAL / period)):
        copy.compute(k * period, experiment.q0, experiment.v0)
        handles.turn_knobs()


_PAGE_POLL = 0.005  # time between two polls [s]
_NICENESS = 5  # the loop has priority where there are many processes
_RATE_WINDOW = 1.0  # time over which the loop's rate is measured [s]


def main() -> int:
    """Show the loop until it has ended; return 0, or 2 after one error message.

    This is the page's process. It draws the rows of the loop's journal, and
    forwards the page's commands. It reads lines of JSON from its standard input. The
    first has its settings; then it writes the page's address. With ``prepare`` it draws
    the robot and the scene, ``status`` sets the status line, and with ``begin`` it
    draws the loop: until then the loop's process prepares. It ends when its input is
    closed, since the loop has ended then.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C stops the loop only
    os.nice(_NICENESS)
    try:
        if line := sys.stdin.readline():  # otherwise the loop ended at once
            _run(json.loads(line))
    except HspControlError as error:
        print(f"hsp: the loop's page: {error}", file=sys.stderr)
        return 2
    return 0


def _run(settings: dict[str, Any]) -> None:
    port, host, held = (settings[name] for name in ("port", "host", "held"))
    server = PageServer(port, host=host, steerable=True, fresh=held)
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
                    experiment = load_experiment(config)
                    channel = Channel(socket.socket(fileno=settings["channel"]))
                    journal = Path(file)
                    mirror = Mirror(experiment, period, journal, channel, held=held)
                    picture = Picture(mirror, viewer)
                    _show(mirror, picture, server)
                    return
    finally:
        server.close()


def _drawn(loaded: LoadedScenario, server: PageServer) -> Viewer:
    viewer = Viewer(loaded.robot, transport=server, **loaded.scenario.view.all_fields())
    draw_before(viewer, loaded)
    return viewer


def _show(mirror: Mirror, picture: Picture, server: PageServer) -> None:
    due = marked = monotonic()
    marked_at, rate, ended = mirror.t, 0.0, False
    while not ended:
        ended = _ended()  # then continue once more, to draw the last row
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
        sleep(_PAGE_POLL)


def _ended() -> bool:
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(ready) and not os.read(sys.stdin.fileno(), 4096)


if __name__ == "__main__":
    sys.exit(main())
