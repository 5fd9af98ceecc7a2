"""Something odd in a robot's description."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]
"""Of an error, the robot does not load; of a warning, something does not work well; a
note is good to know."""


@dataclass(frozen=True)
class Finding:
    """Something odd in a robot's description.

    Attributes:
        severity: How bad it is.
        check: Which check found it, such as ``inertia``.
        element: The link, joint, file or pair of links that it is about.
        message: What is odd, with the value.
        cure: What would be right, or what to do; empty if nothing is to be done.
    """

    severity: Severity
    check: str
    element: str
    message: str
    cure: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)
