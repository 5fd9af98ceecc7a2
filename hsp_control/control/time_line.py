"""The time line: a setup, and the changes of it that are not over."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from hsp_control.control.changes import Change
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.geometry.start import Start


@dataclass(frozen=True)
class TimeLine:
    """What counts at each time."""

    start: Start  # where the parts were placed
    # all changes: those made while running placed, others as they were given
    made: tuple[Change, ...]
    settled: Setup  # setup with all changes that are over
    open: tuple[Change, ...]  # changes that are not, placed, in order of time

    @classmethod
    def of(cls, setup: Setup, made: Sequence[Change]) -> "TimeLine":
        """Place changes in a setup."""
        # In order of time: a change may refer to what an earlier one has made.
        later, placed = setup, []
        for k in sorted(range(len(made)), key=lambda k: made[k].at):
            with within("changes", k):
                placed.append(made[k].placed(setup.start, later))
                later = placed[-1].apply(later)
        return cls(setup.start, tuple(made), setup, tuple(placed))

    @property
    def setup(self) -> Setup:
        """The setup with all changes."""
        return _applied(self.open, self.settled)

    def with_change(self, change: Change, here: Start | None) -> "TimeLine":
        """Return the time line with one more change."""
        earlier = [each for each in self.open if each.at <= change.at]
        placed = change.placed(here or self.start, _applied(earlier, self.settled))
        opened = sorted((*self.open, placed), key=lambda each: each.at)
        made = (*self.made, change if here is None else placed)
        return replace(self, made=made, open=tuple(opened))

    def settled_at(self, t: float) -> "TimeLine":
        """Return the time line for times from t [s] on, without what is over then."""
        done = list(takewhile(lambda each: each.end <= t, self.open))
        settled = _applied(done, self.settled).settled(t)
        return replace(self, settled=settled, open=self.open[len(done) :])


def _applied(changes: Iterable[Change], setup: Setup) -> Setup:
    for change in changes:
        setup = change.apply(setup)
    return setup
