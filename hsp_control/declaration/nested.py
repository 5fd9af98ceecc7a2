"""Parts inside parts: to find those of one kind, or to replace them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from hsp_control.declaration.located import within
from hsp_control.declaration.part import Part

Kind = TypeVar("Kind", bound=Part)


def parts_within(value: Any, kind: type[Kind]) -> Iterator[Kind]:
    """Yield all parts of a kind inside a part, a mapping or a sequence, or itself."""
    if isinstance(value, kind):
        yield value
    elif isinstance(value, Part):
        yield from parts_within(value.all_fields(), kind)
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from parts_within(each, kind)
    elif isinstance(value, tuple | list):
        for each in value:
            yield from parts_within(each, kind)


def with_parts_replaced(
    value: Any, kind: type[Kind], change: Callable[[Kind], Any]
) -> Any:
    """Return a value in which all parts of a kind are changed; the rest is kept."""
    if isinstance(value, kind):
        return change(value)
    if isinstance(value, Part):
        old = value.all_fields()
        new = with_parts_replaced(old, kind, change)
        changed = {name: new[name] for name in old if new[name] is not old[name]}
        return replace(value, **changed) if changed else value  # type: ignore[type-var]
    if isinstance(value, Mapping):
        made = {}
        for k, each in value.items():
            with within(k):
                made[k] = with_parts_replaced(each, kind, change)
        same = all(made[k] is each for k, each in value.items())
        return value if same else made
    if isinstance(value, tuple | list):
        items = []
        for k, each in enumerate(value):
            with within(k):
                items.append(with_parts_replaced(each, kind, change))
        same = all(a is b for a, b in zip(items, value, strict=True))
        return value if same else type(value)(items)
    return value
