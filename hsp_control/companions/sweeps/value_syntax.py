"""Parse values from the command line: ``1:10:5``, ``normal:0:0.1``, ``a,b``."""

import re
from collections.abc import Callable, Sequence
from typing import Any

from hsp_control.common.exceptions import SweepError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.sweeps.distributions import (
    Choices,
    Distribution,
    Integers,
    LogUniform,
    Normal,
    Uniform,
    linear,
    logarithmic,
)
from hsp_control.config.yaml_reader import YamlError, read_yaml

MAX_LEVELS = 100_000
"""Most values in a range; more is probably a typing error."""

_WHOLE = re.compile(r"[-+]?[0-9]{1,18}")
_WORDS: dict[str, tuple[str, tuple[int, ...], Callable[..., Distribution]]] = {
    "linear": ("linear:LOW:HIGH:COUNT", (3,), linear),
    "log": ("log:LOW:HIGH:COUNT", (3,), logarithmic),
    "uniform": ("uniform:LOW:HIGH", (2,), Uniform),
    "loguniform": ("loguniform:LOW:HIGH", (2,), LogUniform),
    "normal": ("normal:MEAN:DEVIATION[:LOW:HIGH]", (2, 4), Normal),
    "integers": ("integers:LOW:HIGH", (2,), Integers),
}
_INTEGER_ARGUMENTS = {"linear": (2,), "log": (2,), "integers": (0, 1)}


def values(text: str) -> Distribution:
    """Return the distribution for a text: a list, a range, or a random distribution.

    ========================= =========================================================
    ``a,b,c``                 these values, each any YAML: ``[0,0,1],[0,1,0]``
    ``1:10:5``                5 numbers from 1 to 10; also ``linear:1:10:5``
    ``log:1:100:5``           5 numbers with a constant ratio
    ``1:10``                  random numbers, uniform; also ``uniform:1:10``
    ``loguniform:1:100``      random numbers with a uniform logarithm
    ``normal:0:0.1``          random numbers: mean and standard deviation
    ``normal:1:0.1:0:2``      the same, truncated to 0 ... 2
    ``integers:0:999``        random integers, both ends included
    ========================= =========================================================
    """
    text = text.strip()
    if not text:
        raise SweepError(
            "the values are missing; give them as 1,2,5 or 1:10:5 or uniform:1:10"
        )
    word, *arguments = (part.strip() for part in text.split(":"))
    if not arguments or text[0] in "[{'\"":
        return Choices(tuple(_listed(text)))
    if word in _WORDS:
        return _spelled(word, arguments)
    if _number(word) is None:
        raise SweepError(
            f"unknown kind of range {word!r}{did_you_mean(word, _WORDS)} "
            f"(allowed: {', '.join(_WORDS)}; put text with a colon in quotes)"
        )
    numbers = [word, *arguments]
    if len(numbers) > 3:
        raise SweepError(
            f"{text} has {len(numbers)} parts; a range is LOW:HIGH[:COUNT]"
        )
    return _spelled("uniform" if len(numbers) == 2 else "linear", numbers)


def _spelled(word: str, arguments: Sequence[str]) -> Distribution:
    form, counts, make = _WORDS[word]
    numbers = [_number(argument) for argument in arguments]
    if len(numbers) not in counts:
        raise SweepError(f"{word} has {len(numbers)} numbers; needs {form}")
    for place, (number, argument) in enumerate(zip(numbers, arguments, strict=True)):
        whole = place in _INTEGER_ARGUMENTS.get(word, ())
        if number is None or (whole and not isinstance(number, int)):
            what = "an integer" if whole else "a number"
            raise SweepError(f"{argument!r} is not {what}; needs {form}")
        if form.endswith("COUNT") and whole and number > MAX_LEVELS:
            raise SweepError(
                f"the range has {number} values; at most {MAX_LEVELS} are allowed"
            )
    return make(*numbers)


def _number(text: str) -> int | float | None:
    if _WHOLE.fullmatch(text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return None


def _listed(text: str) -> list[Any]:
    try:
        found, _ = read_yaml(f"[{text}]")
    except YamlError as error:
        raise SweepError(error.message.replace("not YAML: ", "not a list: ")) from None
    return list(found)
