"""What all delays by whole control periods share."""

from hsp_control.common.exceptions import SimulationError


def check_periods(periods: int, what: str) -> None:
    """Refuse a delay that is no number of periods.

    Raises:
        SimulationError: If it is not a whole number, or negative.
    """
    if not isinstance(periods, int) or periods < 0:
        raise SimulationError(f"{what} is {periods!r}; needs a number of periods")
