"""A factor: one key path of a configuration, and its values."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.errors import SweepError
from hsp_control.companions.sweeps.values import Values, is_distribution, parsed
from hsp_control.declaration.located import split_assignment, written


@dataclass(frozen=True)
class Factor:
    """A varied parameter.

    Attributes:
        keys: The parts of its key path, as text.
        values: Its values: a sequence of plain data, or a distribution.
    """

    keys: tuple[str, ...]
    values: Values

    @property
    def name(self) -> str:
        """The key path with dots: the name of its column in the result."""
        return written(self.keys)

    @property
    def origin(self) -> str:
        """The origin of its values for messages, instead of file and line."""
        return f"--over {self.name}"

    def description(self) -> dict[str, Any]:
        """Return the factor as JSON data."""
        values: Any = self.values
        if isinstance(values, range):
            return {"key": self.name, "integers": [values[0], values[-1]]}
        if not is_distribution(values):
            return {"key": self.name, "values": list(values)}
        numbers = {**dict(enumerate(values.args)), **values.kwds}
        shown = {str(key): repr(float(number)) for key, number in numbers.items()}
        return {"key": self.name, "distribution": values.dist.name, "numbers": shown}


def factors(over: Mapping[str, Any] | Iterable[str]) -> tuple[Factor, ...]:
    """Return the factors of a sweep."""
    pairs = over.items() if isinstance(over, Mapping) else map(_split, over)
    found = [_factor(key, spec) for key, spec in pairs]
    if not found:
        raise SweepError(
            "nothing is varied; give --over, for example --over null_space.gain=1:20:5"
        )
    names = [factor.name for factor in found]
    for name in names:
        if names.count(name) > 1:
            raise SweepError(f"--over {name}: is given twice")
    return tuple(found)


def _split(text: str) -> tuple[str, str]:
    try:
        keys, spec = split_assignment(text)
    except ValueError:
        raise SweepError(
            f"--over {text}: needs the form key=values, for example "
            "null_space.gain=1:20:5"
        ) from None
    return written(tuple(keys)), spec


def _factor(key: str, spec: Any) -> Factor:
    try:
        keys, rest = split_assignment(f"{key}=")
    except ValueError:
        rest = key
    if rest:
        raise SweepError(f"--over {key}: is not a key path such as null_space.gain")
    try:
        return Factor(tuple(keys), _values(spec))
    except SweepError as error:
        raise SweepError(f"--over {key}: {error}") from None


def _values(spec: Any) -> Values:
    if isinstance(spec, str):
        return parsed(spec)
    if is_distribution(spec):
        return spec
    if isinstance(spec, np.ndarray):
        spec = spec.tolist()
    if not isinstance(spec, list | tuple | range):
        raise SweepError(
            f"{spec!r} is not valid; needs text such as '1:10:5', a list of values, or "
            "a distribution such as scipy.stats.norm(0, 0.1)"
        )
    if not spec:
        raise SweepError("the list of values is empty")
    if isinstance(spec, range):
        return spec
    return tuple(_plain(value) for value in spec)


def _plain(value: Any) -> Any:
    """Return NumPy scalars and arrays as Python numbers and lists, for JSON."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
