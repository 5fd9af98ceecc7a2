"""Settings of a plant as JSON data, for the log."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def described(value: Any) -> Any:
    """Return a setting as JSON data: a dataclass by its type and its own fields."""
    if is_dataclass(value):
        own = {f.name: described(getattr(value, f.name)) for f in fields(value)}
        return {"type": type(value).__name__, **own}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [described(item) for item in value]
    return value
