"""Whether Cyclone DDS is installed."""

from hsp_control.common.errors import HardwareError

INSTALL = "pip install 'hsp_control[ros2]'"


def check_installed() -> None:
    """Raise if Cyclone DDS cannot be imported."""
    try:
        import cyclonedds.domain  # noqa: F401
    except ImportError as error:
        raise HardwareError(
            f"ros2:// needs Cyclone DDS; install it with: {INSTALL}"
        ) from error
