"""The check that all delays by whole control periods share."""

from hsp_control.common.exceptions import SimulationError


def check_periods(periods: int, what: str) -> None:
    """Check that a delay is a non-negative whole number of periods.

    Args:
        periods: The delay, in control periods.
        what: Names the delay in the message.

    Raises:
        SimulationError: If it is not a whole number, or negative.
    """
    if not isinstance(periods, int) or periods < 0:
        raise SimulationError(
            f"{what} is {periods!r}; needs a whole number of periods, 0 or more"
        )
