"""Converts settings of a plant to JSON data, for the log."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def to_json_data(value: Any) -> Any:
    """Return a setting as JSON data; a dataclass becomes its type and its fields."""
    if is_dataclass(value):
        items = {f.name: to_json_data(getattr(value, f.name)) for f in fields(value)}
        return {"type": type(value).__name__, **items}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [to_json_data(item) for item in value]
    return value
