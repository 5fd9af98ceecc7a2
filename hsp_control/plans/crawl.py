"""A quadruped that crawls: what YAML and Python say."""

from dataclasses import KW_ONLY
from typing import ClassVar

from hsp_control.control.controller import Controller
from hsp_control.declaration.quantities import Positive, ProperFraction
from hsp_control.plans.crawling import RunningCrawl
from hsp_control.plans.quadruped import QuadrupedPlan
from hsp_control.tasks import Gains


class Crawl(QuadrupedPlan, type="crawl"):
    """A quadruped crawls: one foot swings while three bear, and it could stop any time.

    On four feet the centre of mass moves above the triangle of the three that will
    bear; there it rests while the fourth swings. The feet follow each other on each
    side, the hind one first (McGhee and Frank 1968). A foot lands half a stride ahead
    of its place; it is a contact when it is felt, early or late, higher or lower.
    """

    gait: ClassVar[str] = "crawl"
    center_priority: ClassVar[int] = 1
    center_gains: ClassVar[Gains] = Gains(natural_frequency=8.0)

    _: KW_ONLY
    swing: Positive = 0.35
    """Duration of a swing [s]."""
    stance: Positive = 0.45
    """Duration of the time on four feet between two swings, in which the body moves
    [s]."""
    margin: ProperFraction = 0.3
    """By which share the triangle of the feet is made smaller for the centre of mass
    [-]."""

    def begin(self, controller: Controller) -> RunningCrawl:
        """Return what crawls; see `Plan.begin`."""
        return RunningCrawl(self.begun(), controller, self.margin)
