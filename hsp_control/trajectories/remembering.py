"""Parts that are fed while a robot moves, and so have a memory of the run."""

from copy import deepcopy
from typing import Any, TypeVar

from hsp_control.declaration import Part
from hsp_control.declaration.nested import with_parts_replaced


class Remembering(Part):
    """A part with a memory: whoever has the value may feed it.

    A deep copy goes on by itself, from what the memory held then.
    """


Holder = TypeVar("Holder", bound=Part)


def with_memories_copied(part: Holder, memo: dict[int, Any]) -> Holder:
    """Return the deep copy of a part: the part itself, but for those with a memory."""
    copied: Holder = with_parts_replaced(
        part, Remembering, lambda each: deepcopy(each, memo)
    )
    return copied
