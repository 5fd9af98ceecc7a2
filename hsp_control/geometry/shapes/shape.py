"""The abstract shape of an obstacle or a contact."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, Self

from hsp_control.common.exceptions import SceneError
from hsp_control.declaration import Part


class Shape(Part, ABC, family="shapes", error=SceneError):
    """The shape of a body, centred on its own frame; a value.

    A subclass declares its parameters as fields (see `Part`) and implements `geometry`
    and `bounding_radius`. If it names a file, it overrides `located`.

    Attributes:
        rounded: Whether a capsule's distance to it has a continuous gradient.
        witness_reversed: Whether Coal returns the witness points in reverse order, and
            the normal with the opposite sign.
    """

    rounded: ClassVar[bool] = False
    witness_reversed: ClassVar[bool] = False

    @abstractmethod
    def geometry(self) -> Any:
        """Return Coal's collision geometry.

        Raises:
            SceneError: If its file cannot be read.
        """

    @property
    @abstractmethod
    def bounding_radius(self) -> float:
        """Radius of a sphere about its origin that contains it [m]; inf for a plane."""

    def located(self, folder: str | Path) -> Self:
        """Return this shape with the absolute path of its file, if it has one.

        Args:
            folder: Where a relative path begins.
        """
        return self
