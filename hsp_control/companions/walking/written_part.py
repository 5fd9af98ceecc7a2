"""Parts that a plan writes while the robot moves."""

from typing import Any, Self

from hsp_control.common.arrays import Array
from hsp_control.declaration.nested import Remembering


class Written(Remembering):
    """A part whose memory is one array, which a plan writes while the robot moves."""

    @property
    def memory(self) -> Array:
        """The last written values."""
        if "_memory" not in vars(self):
            vars(self)["_memory"] = self._unwritten()
        memory: Array = vars(self)["_memory"]
        return memory

    def _unwritten(self) -> Array:
        """Return the memory before anything is written."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields and the memory."""
        return super().__getstate__() | {"_memory": self.memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        vars(self)["_memory"] = state["_memory"].copy()  # the other is read-only

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return a part with a separate memory."""
        copied: Self | None = memo.get(id(self))
        if copied is None:
            copied = type(self)(**self.all_fields())
            vars(copied)["_memory"] = self.memory.copy()
            memo[id(self)] = copied
        return copied
