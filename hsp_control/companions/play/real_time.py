"""The loop of a session in real time, and what a page says about time."""

from collections.abc import Callable, Iterable, Mapping
from time import monotonic, sleep
from typing import Any

from hsp_control.companions.play.picture import FRAME, Picture
from hsp_control.companions.play.session import Session

BEHIND = 0.1
"""A session that is later than this goes on from now: it is slower than real time [s].
"""
_RATE_WINDOW = 1.0


def play(
    session: Session,
    picture: Picture,
    messages: Callable[[], Iterable[Mapping[str, Any]]],
    save: Callable[[], str],
    *,
    end: Callable[[], bool] = lambda: False,
) -> None:
    """Let a session go on in real time until it ends; pages never hold it up."""
    running, begin, rate = True, monotonic(), 1.0
    due = drawn = marked = begin
    marked_at = session.t
    while not end():
        steps = 0
        for message in messages():
            match message:
                case {"do": "pause"}:
                    running = False
                case {"do": "go"}:
                    running, due = True, monotonic()
                case {"do": "step"}:
                    running, steps = False, steps + 1
                case {"do": "reset"}:
                    session.reset()
                    picture.begin()
                    due = monotonic()
                case {"do": "save"}:
                    session.handles.say(save())
                    due = monotonic()
                case _:
                    session.receive(message)
        now = monotonic()
        for _ in range(steps):
            session.advance()
        if running and not session.over:
            if now - due > BEHIND:
                due = now
            if now >= due:
                session.advance()
                due += session.row
        now = monotonic()
        if now - marked >= _RATE_WINDOW:
            rate = max(session.t - marked_at, 0.0) / (now - marked)
            marked, marked_at = now, session.t
        if now - drawn >= FRAME:
            picture.draw(running=running and not session.over, rate=rate)
            drawn = now
        wait = due if running and not session.over else drawn + FRAME
        sleep(max(min(wait - monotonic(), FRAME), 0.0))
