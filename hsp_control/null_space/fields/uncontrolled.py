"""No field: self-motion is not controlled."""

from typing import ClassVar

from hsp_control.common.exceptions import FieldError
from hsp_control.null_space.fields.rest import Rest


class Uncontrolled(Rest, type="uncontrolled"):
    """φ_N = 0: self-motion is not controlled. The paper's first simulation.

    Only for demonstration. The task is tracked, but nothing damps the self-motion, and
    the joints drift away while the task error shows nothing. It has no weight, and
    cannot be added to other fields.
    """

    controls: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check that it has no weight."""
        if self.weight != 1.0:
            raise FieldError("an uncontrolled null space has no weight")
