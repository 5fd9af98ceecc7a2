"""All errors that the package raises on purpose.

They have one base class, `HspControlError`. They also derive from the built-in
exception that fits, so ``except ValueError`` works as well. A message states the
given and the valid values; if a name does not exist, it suggests the nearest one.
"""


class HspControlError(Exception):
    """Base class of all errors of this package.

    Attributes:
        location: File and line of the configuration that caused the error
            (``panda.yaml:12``), or None. If it is set, the message begins with it.
        path: The key path of the wrong value, such as ("tasks", "hand", "frame"), if it
            is known. The message then contains it.
    """

    location: str | None = None
    path: tuple[str | int, ...] = ()
    _bare: str | None = None

    @property
    def bare_message(self) -> str:
        """The message without location and path."""
        if self._bare is None:
            self._bare = str(self)
        return self._bare


class ShapeError(HspControlError, ValueError):
    """An array has a shape that does not fit the robot, the task or the argument."""


class NonFiniteError(HspControlError, ValueError):
    """An argument contains NaN or inf where finite numbers are needed."""


class ImmutableError(HspControlError, AttributeError):
    """A value cannot be assigned; the message names the method that changes it."""


class GainError(HspControlError, ValueError):
    """Gains are negative, not positive definite, incomplete or of the wrong shape."""


class RobotNotFoundError(HspControlError, FileNotFoundError):
    """No robot has this name, or its URDF file does not exist or cannot be read."""


class AccessError(HspControlError, PermissionError):
    """A file may not be read: strict reading does not allow its folder or its format.

    See `hsp_control.robot.description.access`.
    """


class ModelError(HspControlError, ValueError):
    """A robot cannot be built: its URDF, SRDF or a collision mesh is invalid.

    Also raised for a valid URDF whose dynamics cannot be computed, for example because
    the mass matrix is singular.
    """


class FrameNotFoundError(HspControlError, LookupError):
    """The robot has no frame with this name."""


class JointNotFoundError(HspControlError, LookupError):
    """The robot has no moving joint with this name."""


class ConfigurationError(HspControlError, ValueError):
    """A vector q is no configuration: a quaternion or (cos, sin) pair has norm ≠ 1.

    Also raised where a run begins with angles that look like degrees.
    """


class TrajectoryError(HspControlError, ValueError):
    """The parameters of a trajectory are invalid or contradict each other."""


class StreamError(HspControlError, ValueError):
    """A streamed target is invalid, its source cannot be opened, or it is missing."""


class TaskError(HspControlError, ValueError):
    """The parameters of a task are invalid, or this robot cannot perform the task."""


class FieldError(HspControlError, ValueError):
    """A null-space field or cost is invalid, or returned a wrong shape, NaN or inf."""


class RateError(HspControlError, ValueError):
    """A rate, a gradient or an error equation that a part declares is wrong."""


class MetricError(HspControlError, ValueError):
    """A joint-space metric is not a symmetric positive definite matrix."""


class SceneError(HspControlError, ValueError):
    """An obstacle is invalid, does not exist, or touches the robot at the start."""


class ScheduleError(HspControlError, ValueError):
    """The time intervals of a schedule overlap, or are empty or shorter than ramps."""


class LimitError(HspControlError, ValueError):
    """Limits are invalid or contradict each other, or the start is outside them."""


class ContactError(HspControlError, ValueError):
    """A contact is invalid for this robot, or a floating base has no contact."""


class ControllerError(HspControlError, ValueError):
    """The parts of a controller do not fit together, or a request to it is invalid."""


class CompensationError(HspControlError, ValueError):
    """The parameters of a compensator are invalid, or it does not fit the robot."""


class UnstableRateError(HspControlError, ValueError):
    """The sampled control loop is unstable with these gains, delays and period."""


class FreezeError(HspControlError, ValueError):
    """A controller cannot run without Python; the message names the part."""


class PlanError(HspControlError, ValueError):
    """A plan is invalid, or does not fit the robot, its contacts or its tasks."""


class EstimationError(HspControlError, ValueError):
    """An estimator does not fit the robot, or its inputs are not measured."""


class FallError(HspControlError, RuntimeError):
    """The robot falls: no plan can continue."""


class SimulationError(HspControlError, RuntimeError):
    """A simulation cannot start, or it diverged.

    Also raised for invalid settings of a plant or an integrator.

    Attributes:
        rollout: The `Rollout` up to the time of the error, or None.
    """

    rollout: object | None = None


class LogError(HspControlError, ValueError):
    """A log file is missing, incomplete or invalid, or cannot be written."""


class ConfigError(HspControlError, ValueError):
    """A configuration does not exist, or does not follow the schema."""


class SweepError(HspControlError, ValueError):
    """A sweep is invalid, or its file cannot be read or written."""


class ViewerError(HspControlError, RuntimeError):
    """A 3-D view cannot be opened or used, or its browser page was closed."""


class ExportError(HspControlError, RuntimeError):
    """A web page or a film cannot be written."""


class PlotError(HspControlError, ValueError):
    """A figure cannot be drawn from a log or a sweep, or cannot be written."""


class LiveError(HspControlError, ValueError):
    """Settings of a live loop are invalid, or it does not support this robot."""


class EngineError(HspControlError, RuntimeError):
    """A user's own compiled part does not compile, or defines nothing."""


class HardwareError(HspControlError, RuntimeError):
    """The robot cannot be reached, is not ready, or stopped sending its state."""
