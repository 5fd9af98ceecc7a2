"""A contact that holds exactly."""

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part, within
from hsp_control.declaration.named import BY_FRAME, stored_by_frame
from hsp_control.declaration.quantities import ArrayField
from hsp_control.trajectories.schedule import Intervals, Schedule

ContactKind = Literal["point", "surface"]


class RigidContact(Part, error=SimulationError):
    """A rigid contact that pushes and pulls on a frame, without slip."""

    yaml_key: ClassVar[str | None] = "frame"

    frame: str
    """Name of the frame [-]; forces are logged under it. In YAML, its key."""
    kind: ContactKind = "surface"
    """Whether only the frame's origin is held, or also its orientation [-]."""
    on: Intervals | None = None
    """Intervals in which the contact is active: [start, end] [s], None for no start or
    no end; always by default."""

    def __post_init__(self) -> None:
        """Check that the intervals follow one another."""
        with within("on"):
            _ = self._schedule

    @property
    def rows(self) -> int:
        """How many velocities it keeps at zero."""
        return 3 if self.kind == "point" else 6

    def holds(self, t: float) -> bool:
        """Return whether it holds at time t [s]."""
        return self._schedule.active(t)

    @cached_property
    def _schedule(self) -> Schedule:
        if self.on is None:
            return Schedule.always()
        return Schedule(self.on, ramp=0.0)


RigidContactsByFrame = Annotated[
    Sequence[RigidContact],
    ArrayField(
        Annotated[dict[str, RigidContact], Field(min_length=1)], stored_by_frame
    ),
    BY_FRAME,
]
"""Contacts: a sequence in Python, a mapping by frame in YAML; at least one."""
