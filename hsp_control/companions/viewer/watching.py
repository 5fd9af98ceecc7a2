"""Watch a user's own loop: the side of the loop, which writes the rows to show."""

import json
import select
import subprocess
import sys
import threading
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self
from weakref import finalize

from hsp_control.common.errors import HspControlError, ViewerError
from hsp_control.companions.viewer.transport import LOOPBACK, open_browser
from hsp_control.config import Recorder
from hsp_control.config.scenario import ViewSettings
from hsp_control.control.interface import Change, Controller
from hsp_control.declaration.plain_data import plain_data
from hsp_control.live.hardware import described
from hsp_control.simulation.declared_run import declared_controller
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.simulate import SimulationSettings

START = 60.0  # time in which the page's process must report its address [s]
RATE = 30.0  # rate at which states are copied from a controller [1/s]
_PATIENCE = 0.5  # time after a failure without another attempt [s]
_ROWS = 20_000  # of a journal, some 60 MB; then another one is begun


class Watch:
    """A page that shows a user's own loop; see `watch`.

    Attributes:
        url: The page's address.
    """

    def __init__(
        self, process: subprocess.Popen[bytes], url: str, follower: "Follower | None"
    ) -> None:
        self.url, self._follower = url, follower
        # Also when the program ends, or the watch is no longer referenced.
        self._end = finalize(self, _end, process, follower)

    def open_browser(self) -> bool:
        """Open the page in the user's browser; return whether there is one."""
        return open_browser(self.url)

    @property
    def failure(self) -> str:
        """Why nothing new is shown while the loop continues; "" without a failure."""
        return "" if self._follower is None else self._follower.failure

    def close(self) -> None:
        """End the page; the loop continues. A second call does nothing."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Watch({self.url})"


def watch(
    loop: Controller | Recorder,
    *,
    port: int | None = None,
    host: str = LOOPBACK,
    show: bool = False,
    **view: Any,
) -> Watch:
    """Show a user's own loop while it runs: scene, targets, distances, plots.

    ``page = hsp.viewer.watch(controller)`` before the loop; the loop itself stays as it
    is. 30 times a second a thread copies the state of the last `Controller.compute`,
    for some microseconds, and computes the drawn quantities with a copy of the
    controller. A `Recorder` has them already: its rows are shown, without a thread. The
    page is in a separate process.

    Args:
        loop: The controller, or a `Recorder` of it.
        port: The server's port; None: a free one.
        host: The address of this computer at which the page can be opened.
        show: Open the page in the user's browser.
        view: Fields of `ViewSettings`, as of `Viewer`.

    Returns:
        The watch, with the page's address; it ends with `Watch.close`, or the program.

    Raises:
        ViewerError: If ``loop`` is neither, a view has no such field, or the page does
        not start.
    """
    if not isinstance(loop, Controller | Recorder):
        raise ViewerError(
            f"can watch a Controller or a Recorder; got {type(loop).__name__}"
        )
    settings = plain_data(ViewSettings(**view))
    follower = Follower(loop) if isinstance(loop, Controller) else None
    journal = follower.journal if follower else loop.journal  # type: ignore[union-attr]
    process = subprocess.Popen(
        [sys.executable, "-m", "hsp_control.companions.viewer.watched_page"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C reaches the loop only
    )
    try:
        url = _address(
            process,
            {"port": port, "host": host, "view": settings, "journal": str(journal)},
        )
    except BaseException:
        _end(process, follower)
        raise
    if follower:
        follower.begin(process)
    found = Watch(process, url, follower)
    if show:
        found.open_browser()
    return found


def _address(process: subprocess.Popen[bytes], settings: dict[str, Any]) -> str:
    """Give the page's process its settings, and return the address that it reports."""
    assert process.stdout is not None
    _say(process, settings)
    ready, _, _ = select.select([process.stdout], [], [], START)
    url = process.stdout.readline().decode().strip() if ready else ""
    if not url:
        raise ViewerError("the page of the watched loop did not start")
    return url


def _say(process: subprocess.Popen[bytes], message: dict[str, Any]) -> None:
    assert process.stdin is not None
    with suppress(OSError, ValueError):  # it has ended, and reported why
        process.stdin.write(json.dumps(message).encode() + b"\n")
        process.stdin.flush()


def _end(process: subprocess.Popen[bytes], follower: "Follower | None") -> None:
    """End the thread and the process; `watched_page` describes how it notices."""
    if follower is not None:
        follower.end()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Follower:
    """Reads the newest state of a controller, and writes the row that a copy computes.

    The loop waits at most for the copying of a state, and for the interpreter's lock
    while a row is written; see ``hsp_control/companions/viewer/benchmark/watching.py``.
    """

    _begun: bool
    _begin_anew: bool
    _changes: dict[int, Change]

    def __init__(self, controller: Controller) -> None:
        """Copy the controller: here the loop does not run yet."""
        self.failure = ""  # why nothing new is shown
        self._controller = controller
        self._folder = TemporaryDirectory(prefix="hsp-watch-")
        self._files = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._process: subprocess.Popen[bytes] | None = None
        self._copy_anew()
        self.journal = self._new_journal()

    def begin(self, process: subprocess.Popen[bytes]) -> None:
        """Begin to follow; the page's process is notified of each new journal."""
        self._process = process
        self._thread.start()

    def end(self) -> None:
        """End the thread, and remove its files."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._writer.close()
        self._folder.cleanup()

    def _run(self) -> None:
        last = (-1.0, b"")
        while not self._ended.wait(1.0 / RATE):
            try:
                taken = self.newest()
                if taken is None or (taken[0], taken[1].tobytes()) == last:
                    continue
                last = taken[0], taken[1].tobytes()
                self.write(*taken)
                self.failure = ""
            # the loop has the same error, or soon will
            except HspControlError as error:
                self.failure, self._begin_anew = str(error), True
                # A copy takes the lock for some ms: not at every failure.
                self._ended.wait(_PATIENCE)
            except BaseException as error:  # a user's part may raise anything
                self.failure = described(error)
                return

    def newest(self) -> tuple[float, Any, Any] | None:
        """Return time, q and v of the last step, copied; None before the first one."""
        controller = self._controller
        with controller._lock:  # no step is in progress
            if not controller._memory.begun:
                return None
            state = controller.state
            return state.t, state.q.copy(), state.v.copy()

    def write(self, t: float, q: Any, v: Any) -> None:
        """Write the row of a state."""
        self._catch_up()
        copy = self._copy
        output = copy.compute(t, q, v)
        self._writer.record(copy.state, output, output.tau, {})
        if self._writer.count >= _ROWS:
            self._change_journal()

    def _change_journal(self) -> None:
        old, before = self.journal, self._writer
        self.journal = self._new_journal()
        if self._process is not None:
            _say(self._process, {"journal": str(self.journal)})
        before.close()
        old.unlink(missing_ok=True)

    def _catch_up(self) -> None:
        """Apply the changes made since; restart if the loop did."""
        controller = self._controller
        if self._begin_anew or controller._memory.runs != self._followed:
            self._copy_anew()
            self._change_journal()
        if not self._begun:
            # Parts relative to the start are placed as in the loop.
            start = controller.setup.start.state
            self._copy.compute(start.t, start.q, start.v)
            self._begun = True
        changes, known = {id(each): each for each in controller.changes}, self._changes
        for change in (changes[key] for key in changes if key not in known):
            with controller._lock:
                # its stream continues from the state of the loop's, and only reads
                own = deepcopy(change, controller._memory.queues)
            self._copy.change(own)
        self._changes = changes

    def _copy_anew(self) -> None:
        controller = self._controller
        self._copy = controller._ahead()
        memory = controller._memory
        self._followed, self._begun = memory.runs, memory.begun
        # the changes that the copy has, by identity
        self._changes = {id(each): each for each in controller.changes}
        self._begin_anew = False

    def _new_journal(self) -> Path:
        config, lost = declared_controller(self._copy, simulation=SimulationSettings())
        self._files += 1
        path = Path(self._folder.name) / f"{self._files}.journal"
        meta = {"name": "watched", "config": config, "config_lost": lost}
        copy = self._copy
        self._writer = LogWriter(copy, copy.scene, 0, path=path, meta=meta)
        return path
