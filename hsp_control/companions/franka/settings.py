"""Settings of a Franka arm, given behind ``franka://`` or in a file."""

from dataclasses import KW_ONLY
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import yaml
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control.common.errors import LiveError
from hsp_control.companions.shared import name_and_options
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    ArrayField,
    Flag,
    NonNegative,
    Number,
    Positive,
    Vector3,
    read_only,
)

_Row3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
_Matrix3 = Annotated[
    ArrayLike,
    ArrayField(Annotated[list[_Row3], Field(min_length=3, max_length=3)], read_only),
]
_Positive6 = Annotated[
    ArrayLike,
    ArrayField(Annotated[list[Positive], Field(min_length=6, max_length=6)], read_only),
]
_Positive7 = Annotated[
    ArrayLike,
    ArrayField(Annotated[list[Positive], Field(min_length=7, max_length=7)], read_only),
]


_FURTHEST = 2.0
"""Maximum distance of a load's centre of mass from the flange along an axis [m]."""


class Load(Part, error=LiveError):
    """The load of the hand, beyond the end effector set in Desk (``set_load``)."""

    mass: NonNegative
    """Its mass [kg]."""
    _: KW_ONLY
    center: Vector3 = (0.0, 0.0, 0.0)
    """Its centre of mass in the flange frame [m]."""
    inertia: _Matrix3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Its inertia about its centre of mass, along the flange's axes [kg m²]."""

    def __post_init__(self) -> None:
        """Check that the inertia is physically consistent.

        Raises:
            LiveError: If it is not: not symmetric, moments a, b, c with a + b < c, or a
            centre too far away.
        """
        furthest = float(np.abs(np.asarray(self.center)).max())
        if furthest > _FURTHEST:
            raise LiveError(
                f"the centre of mass is {furthest:g} m from the flange along an axis; "
                f"at most {_FURTHEST:g} m"
            )
        inertia = np.asarray(self.inertia)
        moments = np.linalg.eigvalsh(0.5 * (inertia + inertia.T))
        slack = 1e-9 + 1e-6 * abs(moments[2])
        if not np.allclose(inertia, inertia.T, rtol=0.0, atol=slack):
            raise LiveError("the inertia is not symmetric")
        if moments[0] + moments[1] < moments[2] - slack:
            raise LiveError(
                f"no body has the principal moments {moments.round(9).tolist()}: the "
                "two smaller ones add up to the largest at least"
            )


class FrankaSettings(Part, error=LiveError):
    """How the loop connects to a Franka arm, and its settings there."""

    address: Annotated[str, Field(min_length=1)]
    """Address of the control box, a number or a name."""
    _: KW_ONLY
    realtime: Literal["enforce", "ignore"] = "enforce"
    """``enforce``: no motion without a real-time kernel and priority; ``ignore``: any
    computer, for which `communication_constraints_violation` is then likely."""
    lockstep: Flag = False
    """Whether it is a box that waits for every command (``hsp franka-box --lockstep``):
    the loop then waits for each of its states, however late."""
    recover: Flag = False
    """Whether a reflex that is still active from before is reset when connecting. A
    reflex during the run is never reset."""
    load: Load | None = None
    """The load of the hand; None: the robot's own setting is kept."""
    collision_torque: _Positive7 = (20.0, 20.0, 18.0, 18.0, 16.0, 14.0, 12.0)
    """External torques of the joints that stop the robot [N·m], seven numbers."""
    collision_force: _Positive6 = (20.0, 20.0, 20.0, 25.0, 25.0, 25.0)
    """External force and moment at the hand that stop the robot [N, N·m]."""
    cutoff_frequency: Positive | None = None
    """Cutoff of a first-order filter between loop and robot [Hz]; None: no filter."""
    gripper: Annotated[str, Field(pattern=r"^udp://[^/:]+:\d+$")] | None = None
    """Address that receives openings of a finger, ``udp://HOST:PORT``; None: none."""

    def __post_init__(self) -> None:
        """Check the gripper's port."""
        port = int((self.gripper or "udp://host:1").rpartition(":")[2])
        if not 1 <= port <= 65535:
            with within("gripper"):
                raise LiveError(f"port {port} is not between 1 and 65535")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse ``ADDRESS?name=value&...``, or ``FILE.yaml?...``.

        Values are written as in YAML; ``load.mass`` is a key inside ``load``. The text
        overrides the file.

        Raises:
            LiveError: If a name or a value is wrong, or the file cannot be read.
        """
        try:
            where, options = name_and_options(text)
        except ValueError as error:
            raise LiveError(f"franka://{text}: {error}") from None
        data: dict[str, Any] = {"address": where}
        if where.endswith((".yaml", ".yml")):
            data = _read(Path(where))
        for name, value in options.items():
            _put(data, name.split("."), _yaml(value, f"{name}={value}"))
        if "address" not in data:
            raise LiveError(f"{where}: the key address is missing")
        try:
            return cls(**data)
        except LiveError as error:
            wrong = error.bare_message.removeprefix(f"{cls.__name__}: ")
            raise LiveError(f"franka://{text}: {wrong}") from None
        except TypeError as error:  # a key that is not a name
            raise LiveError(f"franka://{text}: {error}") from None


def _read(path: Path) -> dict[str, Any]:
    try:
        data = _yaml(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise LiveError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise LiveError(f"{path}: not UTF-8 text") from None
    if not isinstance(data, dict):
        raise LiveError(f"{path}: needs keys and values, such as address: 172.16.0.2")
    return data


def _yaml(text: str, where: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise LiveError(f"{where}: {' '.join(str(error).split())}") from None


def _put(data: dict[str, Any], path: list[str], value: Any) -> None:
    for key in path[:-1]:
        inner = data.setdefault(key, {})
        if not isinstance(inner, dict):
            raise LiveError(f"{'.'.join(path)}: {key} is {inner!r}, not a mapping")
        data = inner
    data[path[-1]] = value
