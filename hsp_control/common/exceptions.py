"""Every error that the package raises on purpose, under one base class.

Each also is the builtin that a caller would expect to catch, and each message names
what was given, what was wanted and, where names are concerned, the nearest one.
"""


class HspControlError(Exception):
    """Base class of all errors of this package.

    Attributes:
        location: Where in a configuration the cause stands (``panda.yaml:12``), if it
            came from one; the message then begins with it.
    """

    location: str | None = None


class ShapeError(HspControlError, ValueError):
    """An array does not have the shape that the robot or the task asks for."""


class NonFiniteError(HspControlError, ValueError):
    """A NaN or an infinity at a border where only numbers may pass."""


class GainError(HspControlError, ValueError):
    """A gain that is negative, not positive definite or of the wrong shape."""


class RobotNotFoundError(HspControlError, FileNotFoundError):
    """Neither a bundled robot, nor one of example-robot-data, nor a URDF file."""


class AccessError(HspControlError, PermissionError):
    """A file outside the folders that may be read: see `robot.description.access`."""


class ModelError(HspControlError, ValueError):
    """A URDF that does not parse, or a model that no dynamics can be computed for."""


class FrameNotFoundError(HspControlError, LookupError):
    """The robot has no frame of that name."""


class JointNotFoundError(HspControlError, LookupError):
    """The robot has no joint of that name."""


class ConfigurationError(HspControlError, ValueError):
    """A configuration vector that is not a point of the robot's configuration space."""


class TrajectoryError(HspControlError, ValueError):
    """A trajectory whose parameters do not describe a motion."""


class TaskError(HspControlError, ValueError):
    """A task that this robot cannot have."""


class FieldError(HspControlError, ValueError):
    """A field or a cost that is ill-defined, or that returned something unusable."""


class MetricError(HspControlError, ValueError):
    """A joint-space metric that is not symmetric positive definite."""


class SceneError(HspControlError, ValueError):
    """An obstacle that is ill-defined, or that does not exist."""


class ScheduleError(HspControlError, ValueError):
    """Intervals of time that overlap, or leave no room for their ramps."""


class LimitError(HspControlError, ValueError):
    """Limits that contradict each other, or a start outside them."""


class ContactError(HspControlError, ValueError):
    """A contact that this robot cannot have, or a floating base without support."""


class ControllerError(HspControlError, ValueError):
    """Tasks, field and metric that do not fit together."""


class CompensationError(HspControlError, ValueError):
    """A compensator that this robot cannot have, or whose settings make no sense."""


class UnstableRateError(HspControlError, ValueError):
    """Gains, delays and a control period for which the sampled loop is unstable."""


class SimulationError(HspControlError, RuntimeError):
    """A simulation that cannot start, or that diverged.

    Attributes:
        rollout: What had been computed until then, or None.
    """

    rollout: object | None = None


class LogError(HspControlError, ValueError):
    """A file that is not a whole log of this package."""


class ConfigError(HspControlError, ValueError):
    """A configuration file that does not follow the schema."""


class SweepError(HspControlError, ValueError):
    """A sweep that is ill-defined, or whose file cannot be read or written."""


class ViewerError(HspControlError, RuntimeError):
    """A 3-D view that cannot be opened, or that is gone."""


class ExportError(HspControlError, RuntimeError):
    """A page or a film that cannot be written, or what is missing to write it."""


class PlotError(HspControlError, ValueError):
    """A log that cannot be drawn, or a picture that cannot be written."""


class LiveError(HspControlError, ValueError):
    """Settings of a live loop that contradict each other, or a robot it is not for."""


class HardwareError(HspControlError, RuntimeError):
    """A robot that cannot be reached, or that is gone."""
