"""The base class of changes of a controller while it runs."""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY
from typing import Any, Self

from hsp_control.common.exceptions import ControllerError
from hsp_control.control.setup import Setup
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Number
from hsp_control.geometry.start import Start
from hsp_control.trajectories.remembering import with_memories_copied


class Change(Part, ABC, family="changes", error=ControllerError):
    """A change that begins at a time and takes a while; efforts stay continuous.

    Changes count in the order of their times, whatever the order in which they are
    made. Each continues from what is then in force, so that several may overlap. A
    subclass implements `apply`.
    """

    _: KW_ONLY
    at: Number
    """When it begins [s]; a time that has passed means now."""
    ramp: NonNegative = 0.3
    """How long it takes [s]; 0 is a jump."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return the change; what has a memory in it goes on by itself."""
        return with_memories_copied(self, memo)

    @property
    def end(self) -> float:
        """When it is complete [s]."""
        return self.at + self.ramp

    @abstractmethod
    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this change, after all earlier ones."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its parts placed; see `Task.placed`."""
        return self
