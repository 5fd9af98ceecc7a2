"""Fields that are given in more forms than they are read in, for type checkers."""

from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar

_Read = TypeVar("_Read")
_Written = TypeVar("_Written")

if TYPE_CHECKING:

    class Given(Generic[_Read, _Written]):
        """A field that is read as one type, and may be given as another one, too.

        ``center: Given[Trajectory, ArrayLike]`` takes a trajectory or a point that is
        held, and is a trajectory. A checker takes a field's type in the constructor
        from ``__set__`` if it has one, and that of the attribute from ``__get__``.
        """

        def __get__(self, part: object, cls: type) -> _Read:
            """Return the field."""

        def __set__(self, part: object, value: _Read | _Written) -> None:
            """Take the field in the constructor."""

else:
    Given = Annotated  # the other forms are those of `Declared.of_value`


def default(value: object) -> Any:
    """Return a default: a checker would compare its type with `Given`."""
    return value
