"""How a run is shown."""

from hsp_control.config.models.base import Model, Positive, Vector3


class ViewModel(Model):
    """The 3-D view."""

    camera: Vector3 | None = None
    """Where one looks from [m]; chosen to see the whole robot by default."""
    target: Vector3 | None = None
    """Where one looks at [m]."""
    speed: Positive = 1.0
    """Seconds of motion shown in one second."""
