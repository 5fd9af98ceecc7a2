"""The browser view of a command: open it, keep it open, close it."""

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
"""Time in which a started browser must show the page [s]."""


class Screen:
    """Shows a run while it is computed, and after."""

    def __init__(self, viewer: Viewer, experiment: Experiment, *, opened: bool) -> None:
        """Show the robot and the scene before the run."""
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
        """Open the view; if that fails, print why and return None."""
        view = experiment.scenario.view.all_fields()
        with ExitStack() as stack:
            try:
                viewer = Viewer(experiment.robot, port=options.port, **view)
                stack.enter_context(viewer)
                announce(f"View: {viewer.url}")
                opened = options.browser and viewer.open_browser()
                screen = cls(viewer, experiment, opened=opened)
            except ViewerError as error:
                message = f"hsp: {error}; the run continues without a view"
                print(message, file=sys.stderr)
                return None
            stack.pop_all()  # the viewer stays open
        return screen

    def on_row(self, recorder: Recorder) -> None:
        """Show the rows computed so far."""
        self._live.on_row(recorder)

    def finish(self, rollout: Rollout) -> None:
        """Show the whole run until the user closes the view.

        Raises:
            ViewerError: If the server has ended.
        """
        self._live.finish(rollout)
        attend(self._viewer, opened=self._opened)

    def close(self) -> None:
        """Close the view; a second call does nothing."""
        self._viewer.close()


def attend(viewer: Viewer, *, opened: bool) -> None:
    """Keep a view open until the user closes it.

    In a terminal: until Enter or Ctrl-C. Without a terminal: until the page is closed,
    if a browser was opened; otherwise return at once.

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
