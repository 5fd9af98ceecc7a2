"""The places at which a misplaced key would be right."""

from collections.abc import Iterator, Sequence

from hsp_control.declaration.language import joined
from hsp_control.declaration.located import KeyPath, place_of
from hsp_control.declaration.schema import ValueTypes, entry, is_model, keys

_STEPS = 3
"""The farthest places, in keys up and down."""
_MOST = 3
"""More places than these do not show which one was meant."""
_ANY = "*"
"""Any name or number of a part, in a place."""


def home_of(key: str, holder: KeyPath, levels: Sequence[ValueTypes]) -> str:
    """Return ``; it belongs to 'null_space.fields.*'`` for an unknown key, or "".

    Args:
        key: The unknown key.
        holder: The path of the mapping that has it.
        levels: What the root may be, and the value at each part of that path.
    """
    steps: dict[str, int] = {}  # up and down, by place
    for up, level in enumerate(reversed(levels[-_STEPS - 1 :])):
        above = holder[: len(holder) - up]
        for below in _below(level, key, _STEPS - up):
            place = (*above, *below)
            if place == holder or place == (*holder[:-1], _ANY):
                continue  # other types of part there have it
            words = f"to {place_of(place)!r}"
            if up and not below:
                words = f"beside {holder[len(above)]!r}"
            steps.setdefault(words, up + len(below))
    told = [*steps]
    if len(told) > _MOST:
        told = [words for words in told if steps[words] == 1]
    return f"; it belongs {joined(told)}" if 0 < len(told) <= _MOST else ""


def inside(level: ValueTypes, key: str | int) -> ValueTypes:
    """Return what the value of a key may be, in any option."""
    found = (entry(option, key) for option in level.options)
    return ValueTypes(tuple(o for each in found if each for o in each.options))


def _below(level: ValueTypes, key: str, steps: int) -> Iterator[KeyPath]:
    """Yield the paths of mappings that have a key, here and at most so many below."""
    if key in keys(level):
        yield ()
    for name in keys(level) if steps > 0 else ():
        value = inside(level, name)
        for path in _below(value, key, steps - 1):
            yield (name, *path)
        several = tuple(o for o in value.options if not is_model(o))
        for path in _below(inside(ValueTypes(several), 0), key, steps - 2):
            yield (name, _ANY, *path)
