"""Objects whose attributes are assigned once, in ``__init__``."""

from typing import Any

import numpy as np


class Immutable:
    """An object that cannot change after ``__init__``.

    Each attribute can be assigned once. An array that is assigned becomes read-only, so
    assign a copy of an array that belongs to the caller. With ``__slots__`` in each
    class no attribute can be added later. Unpickling assigns in the same way, so that
    its arrays are read-only too.
    """

    __slots__ = ()

    def __setattr__(self, name: str, value: Any) -> None:
        """Assign an attribute for the first and only time.

        Raises:
            AttributeError: If the attribute has a value already.
        """
        if hasattr(self, name):
            raise AttributeError(
                f"{type(self).__name__} is immutable: make a new one to change {name}"
            )
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        """Raise: an attribute cannot be deleted.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(
            f"{type(self).__name__} is immutable: {name} cannot be deleted"
        )

    def __repr__(self) -> str:
        """Return the class and its public attributes."""
        classes = reversed(type(self).__mro__)
        slots = [name for c in classes for name in vars(c).get("__slots__", ())]
        shown = (f"{n}={getattr(self, n)!r}" for n in slots if not n.startswith("_"))
        return f"{type(self).__name__}({', '.join(shown)})"
