"""The values of a swept parameter: a sequence, or a distribution of `scipy.stats`.

A design is then only a set of fractions in [0, 1), independent of the distributions:
each value is the quantile at a fraction.
"""

import math
import re
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SweepError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.config.yaml_reader import YamlError, read_yaml

Distribution: TypeAlias = Any  # as stats.norm(0.0, 0.1) returns
Values: TypeAlias = Sequence[Any] | Distribution

MAX_LEVELS = 100_000
"""Maximum number of values in a range; more is probably a typing error."""

# Between these all quantiles are finite, and those of integers are within their ends.
_LOWEST, _HIGHEST = 2.0**-53, 1.0 - 2.0**-53
_WHOLE = re.compile(r"[-+]?[0-9]{1,18}")


def is_distribution(values: Values) -> bool:
    """Return whether the values are a distribution, and not a sequence."""
    return hasattr(values, "ppf")


def quantiles(values: Values, fractions: Array) -> list[Any]:
    """Return the quantiles at fractions in [0, 1), shape (N,)."""
    if isinstance(values, Sequence):
        return [values[int(place)] for place in fractions * len(values)]
    found: list[Any] = values.ppf(np.clip(fractions, _LOWEST, _HIGHEST)).tolist()
    return found


def parsed(text: str) -> Values:
    """Return the values that a text declares: a list, a range, or a distribution.

    ========================= =========================================================
    ``a,b,c``                 these values, each any YAML: ``[0,0,1],[0,1,0]``
    ``1:10:5``                5 numbers from 1 to 10; also ``linear:1:10:5``
    ``log:1:100:5``           5 numbers with a constant ratio
    ``1:10``                  random numbers, uniform; also ``uniform:1:10``
    ``loguniform:1:100``      random numbers with a uniform logarithm
    ``normal:0:0.1``          random numbers: mean and standard deviation
    ``normal:1:0.1:0:2``      the same, truncated to 0 ... 2
    ``integers:0:999``        integers, both ends included
    ========================= =========================================================
    """
    text = text.strip()
    if not text:
        raise SweepError(
            "the values are missing; give them as 1,2,5 or 1:10:5 or uniform:1:10"
        )
    word, *arguments = (part.strip() for part in text.split(":"))
    if not arguments or text[0] in "[{'\"":
        return _listed(text)
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


def _listed(text: str) -> tuple[Any, ...]:
    try:
        found, _ = read_yaml(f"[{text}]")
    except YamlError as error:
        raise SweepError(error.message.replace("not YAML: ", "not a list: ")) from None
    return tuple(found)


def _spelled(word: str, arguments: Sequence[str]) -> Values:
    form, counts, make, whole = _WORDS[word]
    numbers = [_number(argument) for argument in arguments]
    if len(numbers) not in counts:
        raise SweepError(f"{word} has {len(numbers)} numbers; needs {form}")
    for place, (number, argument) in enumerate(zip(numbers, arguments, strict=True)):
        integer = place in whole
        if number is None or (integer and not isinstance(number, int)):
            what = "an integer" if integer else "a number"
            raise SweepError(f"{argument!r} is not {what}; needs {form}")
    return make(*numbers)


def _number(text: str) -> int | float | None:
    if _WHOLE.fullmatch(text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return None


# --- the ranges, by the words of `parsed` ---------------------------------------------


def _linear(low: float, high: float, count: int) -> Sequence[float]:
    """Return evenly spaced numbers; integers, if the ends and the spacing are."""
    _check(low, high, count)
    steps = count - 1
    if isinstance(low, int) and isinstance(high, int) and (high - low) % steps == 0:
        return tuple(range(low, high + 1, (high - low) // steps))
    inner = (low + (high - low) * (k / steps) for k in range(1, steps))
    return (float(low), *inner, float(high))


def _logarithmic(low: float, high: float, count: int) -> Sequence[float]:
    """Return numbers with a constant ratio."""
    _check(low, high, count, positive=True)
    steps = count - 1
    inner = (low * (high / low) ** (k / steps) for k in range(1, steps))
    return (float(low), *inner, float(high))


def _uniform(low: float, high: float) -> Distribution:
    from scipy import stats  # here, because this import is slow

    _check(low, high)
    return stats.uniform(low, high - low)


def _log_uniform(low: float, high: float) -> Distribution:
    from scipy import stats  # here, because this import is slow

    _check(low, high, positive=True)
    return stats.loguniform(low, high)


def _normal(
    mean: float, deviation: float, low: float = -math.inf, high: float = math.inf
) -> Distribution:
    from scipy import stats  # here, because this import is slow

    if not (math.isfinite(mean) and 0.0 < deviation < math.inf):
        raise SweepError(
            f"a normal distribution of mean {mean:g} and standard deviation "
            f"{deviation:g}; both must be finite, the deviation positive"
        )
    if not low < high:
        raise SweepError(
            f"a normal distribution is cut to {low:g} ... {high:g}; low must be below "
            "high"
        )
    if math.isinf(low) and math.isinf(high):
        return stats.norm(mean, deviation)
    ends = (low - mean) / deviation, (high - mean) / deviation
    return stats.truncnorm(*ends, mean, deviation)


def _integers(low: int, high: int) -> Sequence[int]:
    if low > high:
        raise SweepError(f"there are no integers from {low} to {high}")
    return range(low, high + 1)


def _check(
    low: float, high: float, count: int | None = None, *, positive: bool = False
) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SweepError(
            f"the interval is from {low:g} to {high:g}; its ends must be finite, and "
            "the first below the second"
        )
    if positive and low <= 0.0:
        raise SweepError(
            f"the range begins at {low:g}; a logarithmic range must be positive"
        )
    if count is not None and not 2 <= count <= MAX_LEVELS:
        limit = "at least 2" if count < 2 else f"at most {MAX_LEVELS}"
        raise SweepError(f"the range has {count} values; {limit} are allowed")


_WORDS: dict[str, tuple[str, set[int], Callable[..., Values], set[int]]] = {
    # its form, its number of numbers, its constructor, which numbers are integers
    "linear": ("linear:LOW:HIGH:COUNT", {3}, _linear, {2}),
    "log": ("log:LOW:HIGH:COUNT", {3}, _logarithmic, {2}),
    "uniform": ("uniform:LOW:HIGH", {2}, _uniform, set()),
    "loguniform": ("loguniform:LOW:HIGH", {2}, _log_uniform, set()),
    "normal": ("normal:MEAN:DEVIATION[:LOW:HIGH]", {2, 4}, _normal, set()),
    "integers": ("integers:LOW:HIGH", {2}, _integers, {0, 1}),
}
