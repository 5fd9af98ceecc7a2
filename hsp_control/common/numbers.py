"""Numbers that a user gives in Python: checked before they are compared."""

from math import inf
from numbers import Real

from hsp_control.common.errors import HspControlError


def check_positive(
    name: str, value: object, unit: str, error: type[HspControlError]
) -> float:
    """Return a finite number above zero, or raise an error of the given class."""
    if not isinstance(value, Real) or isinstance(value, bool):
        of_unit = unit and f" [{unit}]"
        raise error(f"{name} is {value!r}; needs a positive number{of_unit}")
    number = float(value)
    if not 0.0 < number < inf:
        raise error(f"{name} is {value}{unit and f' {unit}'}; must be positive")
    return number
