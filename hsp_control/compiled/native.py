"""Kernels with their arguments, packed once, as the engine's plans make them."""

from collections.abc import Callable
from typing import Any, Self

from hsp_control.engine import Plan


class NativeCall:
    """A compiled kernel, or a C function, with its arguments: a call of the time.

    Attributes:
        row: The addresses of a function f(words, time) and of the packed arguments.
        kept: What the words point to, and the words.
        recipe: A function and its arguments that make this call. It keeps the arrays
            alive, and copies and pickles use it to bind the copied arrays.
    """

    __slots__ = ("kept", "recipe", "row")

    def __init__(
        self, row: tuple[int, int], recipe: tuple[Any, ...], kept: object
    ) -> None:
        self.row, self.recipe, self.kept = row, recipe, kept

    def __call__(self, t: float = 0.0) -> float:
        """Make the call."""
        return Plan([self])(t)

    @classmethod
    def of(
        cls, kernel: Callable[..., Any], arguments: tuple[Any, ...], timed: bool
    ) -> Self:
        """Pack the arguments, and compile or load the adapter."""
        from hsp_control.compiled import adapters

        kinds, words = adapters.packed(arguments)
        address = adapters.adapter(kernel, kinds, timed)
        recipe = cls.of, (kernel, arguments, timed)
        return cls((address, words.ctypes.data), recipe, (words, arguments))

    def __reduce__(self) -> tuple[Any, ...]:
        return self.recipe
