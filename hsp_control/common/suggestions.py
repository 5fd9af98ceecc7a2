"""Text for error messages about names: the nearest name, and a short list."""

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(word: object, options: Iterable[str]) -> str | None:
    """Return the option that the user probably meant by ``word``, or None.

    One of similar spelling, else the shortest that contains the word of three letters
    or more, or is contained in it: ``hand`` finds ``panda_hand``. No word: None.
    """
    if not isinstance(word, str):
        return None
    folded = {option.casefold(): option for option in options}
    target = word.casefold()
    if close := get_close_matches(target, folded, n=1):
        return folded[close[0]]
    related = [
        option
        for option in folded
        if min(len(option), len(target)) >= 3 and (option in target or target in option)
    ]
    return folded[min(related, key=len)] if related else None


def did_you_mean(word: object, options: Iterable[str]) -> str:
    """Return ``; did you mean 'x'?`` with the nearest option, or an empty string."""
    near = nearest(word, options)
    return "" if near is None else f"; did you mean {near!r}?"


def listing(options: Iterable[str], limit: int = 12) -> str:
    """Return ``a, b, c``, or ``a, b, c, ... (37 in all)`` if the list is long."""
    names = list(options)
    if len(names) <= limit:
        return ", ".join(names)
    return f"{', '.join(names[:limit])}, ... ({len(names)} in all)"
