"""The browser view beside the command line: opened, attended, closed."""

import argparse
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Self

from hsp_control.common.exceptions import ViewerError
from hsp_control.config import Experiment
from hsp_control.simulation import Rollout
from hsp_control.simulation.recorder import Recorder
from hsp_control.visualization.viewer import LiveView, Viewer

PAGE_TIMEOUT = 15.0
"""How long a browser that was started may take to show the page [s]."""


class Screen:
    """A run that is shown while it is computed, and after."""

    def __init__(self, viewer: Viewer, experiment: Experiment, *, opened: bool) -> None:
        """Show the stage."""
        self._viewer = viewer
        self._opened = opened
        self._live = LiveView(viewer, experiment)

    @classmethod
    def open(
        cls,
        experiment: Experiment,
        options: argparse.Namespace,
        announce: Callable[[str], None],
    ) -> Self | None:
        """Open it, or say why it cannot be and return None: the run goes on without."""
        view = experiment.scenario.view.model_dump()
        with ExitStack() as stack:
            try:
                viewer = Viewer(experiment.robot, port=options.port, **view)
                stack.enter_context(viewer)
                announce(f"View: {viewer.url}")
                opened = options.browser and viewer.open_browser()
                screen = cls(viewer, experiment, opened=opened)
            except ViewerError as error:
                print(f"hsp: {error}; the run goes on unseen", file=sys.stderr)
                return None
            stack.pop_all()  # it stays open
        return screen

    def on_row(self, recorder: Recorder) -> None:
        """Show what has been computed."""
        self._live.on_row(recorder)

    def finish(self, rollout: Rollout) -> None:
        """Show the whole run until a person has seen it.

        Raises:
            ViewerError: If the server has ended.
        """
        self._live.finish(rollout)
        attend(self._viewer, opened=self._opened)

    def close(self) -> None:
        """End the view; again is no error."""
        self._viewer.close()


def attend(viewer: Viewer, *, opened: bool) -> None:
    """Keep a view open for as long as a person wants it; a script is not kept.

    In a terminal until Enter or Ctrl-C; elsewhere, if a browser was opened, until its
    page is closed.

    Args:
        viewer: The view.
        opened: Whether a browser was opened.
    """
    with suppress(KeyboardInterrupt):
        if sys.stdin is not None and sys.stdin.isatty():
            with suppress(EOFError):
                input("Press Enter to close the view. ")
        elif opened and viewer.wait_for_browser(PAGE_TIMEOUT):
            viewer.wait_until_closed()
