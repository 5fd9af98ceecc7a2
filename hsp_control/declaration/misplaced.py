"""The places, and the types, of which a misplaced key would be right."""

from collections.abc import Iterator, Sequence

from hsp_control.declaration.language import joined, spoken
from hsp_control.declaration.located import KeyPath, place_of
from hsp_control.declaration.schema import ValueTypes, entry, is_model, keys

_STEPS = 3
"""The farthest places, in keys up and down."""
_MOST = 5
"""More places than these do not show which one was meant."""
_ANY = "*"
"""Any name or number of a part, in a place."""


def home_of(path: KeyPath, levels: Sequence[ValueTypes]) -> str:
    """Return ``; it belongs to 'null_space.fields.*'`` for an unknown key, or "".

    Args:
        path: The unknown key.
        levels: What each mapping around it may be, from the root to its own one.
    """
    *holder, key = path
    steps: dict[str, int] = {}  # up and down, by place
    for up, level in enumerate(reversed(levels[-_STEPS - 1 :])):
        above = holder[: len(holder) - up]
        for below in _below(level, str(key), _STEPS - up):
            place = (*above, *below)
            if place == (*holder[:-1], _ANY):  # others in the same list have it
                continue
            words = f"to {place_of(place)!r}"
            if up and not below:
                words = f"beside {holder[len(above)]!r}"
            steps.setdefault(words, up + len(below))
    told = [*steps]
    if len(told) > _MOST:
        told = [words for words in told if steps[words] == 1]
    return f"; it belongs {joined(told)}" if 0 < len(told) <= _MOST else ""


def relatives_with(key: str, holder: ValueTypes) -> str:
    """Return ``; type frame_pose has it``, of the same family, or "".

    Args:
        key: The unknown key.
        holder: What the mapping is that has it.
    """
    told = [
        spoken(f"type {name}", member.__name__)
        for option in holder.options[:1]  # with its type given it is the only one
        if (family := getattr(option, "family", None)) is not None
        for name, member in family.members.items()
        if key in keys(ValueTypes((member,)))
    ]
    return f"; {joined(told)} has it" if 0 < len(told) <= _MOST else ""


def _inside(level: ValueTypes, key: str | int) -> ValueTypes:
    """Return what the value of a key may be, in any option."""
    found = (entry(option, key) for option in level.options)
    return ValueTypes(tuple(o for each in found if each for o in each.options))


def _below(level: ValueTypes, key: str, steps: int) -> Iterator[KeyPath]:
    """Yield the paths of mappings that have a key, here and at most so many below."""
    if key in keys(level):
        yield ()
    for name in keys(level) if steps > 0 else ():
        value = _inside(level, name)
        for path in _below(value, key, steps - 1):
            yield (name, *path)
        several = tuple(o for o in value.options if not is_model(o))
        for path in _below(_inside(ValueTypes(several), 0), key, steps - 2):
            yield (name, _ANY, *path)
