"""How well the loop of `hsp play` keeps pace while pages draw.

    .venv/bin/python hsp_control/companions/play/benchmark/play.py

A row is due every 10 ms of real time. For each configuration the same session goes on
without a page, with a page in a browser that draws by software, and with one that takes
a single message and no more, in turns. Writes a table into
results.md, beside it.
"""

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hsp_control.companions.film.chromium import headless_browser
from hsp_control.companions.play import Session, play
from hsp_control.companions.play.playable import playable
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.live_picture import Picture
from hsp_control.companions.viewer.transport import PageServer

sys.path.append(str(Path(__file__).parents[4] / "benchmarks"))
sys.path.append(str(Path(__file__).parents[4] / "tests/support"))
from pages import Steering
from shared.marked_sections import replace_section

CONFIGURATIONS = ("panda_obstacle", "dual_panda", "whole_body/talos_circle")
WINDOW, ROUNDS = 5.0, 3  # duration [s] and number of the measurements per condition


class Timed(Session):
    """A session that records begin and duration of the computation of rows."""

    def advance(self) -> None:
        """Go on to the next row."""
        begin = monotonic()
        super().advance()
        self.rows.append((begin, monotonic() - begin))

    def reset(self) -> None:
        """Begin anew."""
        self.rows: list[tuple[float, float]] = []
        super().reset()


def measured(session: Timed, picture: Picture, server: PageServer) -> tuple[Any, float]:
    """Return how late rows begin [s], and the share of time that all of it takes."""
    session.rows.clear()
    begin, drawn = monotonic(), [0.0]
    draw = picture.draw

    def timed(**state: Any) -> None:
        before = monotonic()
        draw(**state)
        drawn[0] += monotonic() - before

    picture.draw = timed  # type: ignore[method-assign]
    end = begin + WINDOW
    play(session, picture, server.messages, lambda: "", end=lambda: monotonic() > end)
    picture.draw = draw  # type: ignore[method-assign]
    starts, lengths = np.array(session.rows).T
    # Lateness relative to the earliest schedule of a row every 10 ms that no row
    # precedes.
    due = session.row * np.arange(len(starts))
    late = starts - due - (starts - due).min()
    return late, float((lengths.sum() + drawn[0]) / WINDOW)


def lines() -> Iterator[str]:
    """Yield the table's lines."""
    late_by = "a row is late by, median [ms] | 99 % | most"
    yield f"| configuration | page | share of a core [%] | {late_by} |"
    yield "|---|---|--:|--:|--:|--:|"
    for name in CONFIGURATIONS:
        found: dict[str, list[tuple[Any, float]]] = {}
        with ExitStack() as stack:
            server = PageServer(steerable=True)
            stack.callback(server.close)
            session = Timed(playable(name))
            session.rehearse()
            view = session.experiment.scenario.view.all_fields()
            viewer = Viewer(session.experiment.robot, transport=server, **view)
            picture = Picture(session, viewer)
            browser = stack.enter_context(headless_browser())
            for _ in range(ROUNDS):
                found.setdefault("none", []).append(measured(session, picture, server))
                page = browser.new_page(viewport={"width": 1280, "height": 800})
                page.goto(server.url)
                viewer.wait_for_browser(60.0)
                found.setdefault("drawing", []).append(
                    measured(session, picture, server)
                )
                page.close()
                stalled = Steering(str(server.url), pause=1e9)
                measured(session, picture, server)
                found.setdefault("stalled", []).append(
                    measured(session, picture, server)
                )
                del stalled
        for page_state, results in found.items():
            late = 1e3 * np.concatenate([each for each, _ in results])
            share = 100.0 * np.mean([each for _, each in results])
            yield (
                f"| `{name}` | {page_state} | {share:.0f} | {np.median(late):.1f} "
                f"| {np.quantile(late, 0.99):.1f} | {late.max():.0f} |"
            )


if __name__ == "__main__":
    text = "\n".join(lines())
    print(text)
    replace_section(Path(__file__).with_name("results.md"), "play", f"{text}\n")
