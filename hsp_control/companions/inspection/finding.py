"""A finding about a robot's description, as checks report it."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]
"""With an error the robot does not load; with a warning something does not work well; a
note is information."""


@dataclass(frozen=True)
class Finding:
    """A finding about a robot's description."""

    severity: Severity  # its severity
    check: str  # the check that found it, such as ``inertia``
    element: str  # the link, joint, file or pair of links concerned
    message: str  # the problem, with the value
    cure: str = ""  # the remedy; empty if none is needed

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)
