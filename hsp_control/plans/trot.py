"""A quadruped that trots: what YAML and Python say."""

from typing import ClassVar

from hsp_control.control.controller import Controller
from hsp_control.plans.quadruped import QuadrupedPlan
from hsp_control.plans.trotting import RunningTrot
from hsp_control.tasks import Gains


class Trot(QuadrupedPlan, type="trot"):
    """A quadruped trots: two diagonal feet swing while two bear.

    It stands, trots with the given velocity, and stands again when that is zero. A
    foot lands where the body will be, farther by what the body is too fast (the capture
    point; Raibert 1986, Pratt et al. 2006). It starts from where it is and becomes a
    contact when it is felt on the ground, early or late, higher or lower.
    """

    gait: ClassVar[str] = "trot"
    center_priority: ClassVar[int] = 2
    center_gains: ClassVar[Gains] = Gains(6.0, 5.0)

    def begin(self, controller: Controller) -> RunningTrot:
        """Return what trots; see `Plan.begin`."""
        return RunningTrot(self.begun(), controller)
