"""Objects whose attributes are bound once, in ``__init__``."""

from typing import Any

import numpy as np


class Immutable:
    """An object that cannot change once it is made.

    An attribute can be bound but not rebound, and an array that is bound becomes
    read-only. With ``__slots__`` in each class no attribute can be added either, and
    unpickling binds, hence freezes, in the same way.
    """

    __slots__ = ()

    def __setattr__(self, name: str, value: Any) -> None:
        """Bind an attribute for the first and only time.

        Raises:
            AttributeError: If the attribute is bound already.
        """
        if hasattr(self, name):
            raise AttributeError(
                f"{type(self).__name__} is immutable: make a new one to change {name}"
            )
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        """Refuse to unbind an attribute.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"{type(self).__name__} is immutable: {name} stays")

    def __repr__(self) -> str:
        """Return the class and its public attributes."""
        classes = reversed(type(self).__mro__)
        slots = [name for c in classes for name in vars(c).get("__slots__", ())]
        shown = (f"{n}={getattr(self, n)!r}" for n in slots if not n.startswith("_"))
        return f"{type(self).__name__}({', '.join(shown)})"
