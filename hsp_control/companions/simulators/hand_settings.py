"""The configuration of a hand whose targets come from a simulator."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, replace
from os import PathLike
from pathlib import Path
from typing import Any

from hsp_control.common.errors import ConfigError
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import located_scene, validate
from hsp_control.config.scenario import NullSpaceSettings
from hsp_control.constraints.limits import Limits, LimitsOrNone
from hsp_control.control.interface import Compensation
from hsp_control.declaration import Part
from hsp_control.geometry.scene import Scene
from hsp_control.null_space.fields import TargetPosture
from hsp_control.tasks import Gains
from hsp_control.trajectories import StreamPose

_POSTURE_RATE = 10.0**0.5
"""Weight and gain [1/s] with which the posture obeys e'' + 2√10 e' + 10 e = 0 in the
null space, as with robosuite's OSC_POSE."""

_UNHURRIED = StreamPose(
    delay=0.11,  # two actions at 20 Hz, and a little
    speed=0.5,
    acceleration=2.0,
    jerk=40.0,
    angular_speed=1.5,
    angular_acceleration=5.0,
    angular_jerk=100.0,
)
"""Bounds that efforts can follow, also if motors are weak for a wrist's rotors."""

Source = str | PathLike[str] | Mapping[str, Any] | None
"""A source of settings: a YAML file, its data, or None for the defaults."""


class HandSettings(Part, error=ConfigError):
    """The controller of one hand: a configuration without robot, tasks and run."""

    _: KW_ONLY
    gains: Gains | None = None
    """Gains of the hand's task; those of the simulator's own controller by default."""
    stream: StreamPose | None = _UNHURRIED
    """How the reference moves from target to target, within which bounds; ``null``: it
    jumps to each target and stays there. For a position the linear bounds apply."""
    null_space: NullSpaceSettings = NullSpaceSettings(
        gain=_POSTURE_RATE, fields=(TargetPosture("start", weights=_POSTURE_RATE),)
    )
    """The control of self-motion; by default the posture of the start attracts."""
    limits: LimitsOrNone = Limits(effort="none")
    """Limits that the law keeps: by default those of the joints' motion. Efforts are
    also clipped, as a simulator clips those of its controllers."""
    compensation: Compensation = Compensation(friction_feed_forward="urdf")
    """Compensators; by default the friction of the simulated joints is fed forward. An
    observer that is ``auto`` is off: the model is the simulator's own."""
    scene: Scene = Scene()
    """Obstacles that fields and limits name."""

    def __post_init__(self) -> None:
        """Check that the simulator can command the stream.

        Raises:
            ConfigError: If it has another source.
        """
        if self.stream is not None and (
            self.stream.source is not None or self.stream.messages is not None
        ):
            raise ConfigError(
                "stream: the targets come from the simulator's actions; remove source "
                "and messages"
            )


def read_settings(source: Source) -> tuple[HandSettings, Document]:
    """Return settings, and the document that adds file and line to later errors.

    Raises:
        HspControlError: If they do not follow the declaration; with the location.
    """
    if isinstance(source, str | PathLike):
        document = Document.read(source)
    else:
        document = Document(dict(source or {}), {}, "hand settings")
    settings = validate(document, HandSettings)
    with document.at():
        folder = Path(document.name).resolve().parent
        scene = located_scene(settings.scene, folder, document.access)
    return replace(settings, scene=scene), document
