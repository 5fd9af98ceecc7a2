"""Something odd in a robot's description, as checks report it."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]
"""Of an error, the robot does not load; of a warning, something does not work well; a
note is good to know."""


@dataclass(frozen=True)
class Finding:
    """Something odd in a robot's description."""

    severity: Severity  # how bad it is
    check: str  # which check found it, such as ``inertia``
    element: str  # the link, joint, file or pair of links that it is about
    message: str  # what is odd, with the value
    cure: str = ""  # what would be right, or what to do; empty if nothing is to be done

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)
