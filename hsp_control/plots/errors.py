"""What goes wrong with pictures."""

from hsp_control.exceptions import HspControlError


class PlotError(HspControlError, ValueError):
    """A log that cannot be drawn, or a picture that cannot be written."""
