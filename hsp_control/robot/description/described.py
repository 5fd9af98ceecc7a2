"""Robots of the package robot_descriptions, by name.

Its modules know the repository of each robot, and clone it at the first import.
"""

import sys
from contextlib import redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from hsp_control.common.exceptions import RobotNotFoundError
from hsp_control.common.suggestions import did_you_mean, listing

PACKAGE = "robot_descriptions"


class Described(NamedTuple):
    """Where the files of a robot are."""

    file: Path  # its URDF, or the xacro file that makes it
    xacro_args: dict[str, str]  # arguments of the xacro file, by name
    package_dirs: tuple[Path, ...]  # folders in which ``package://`` is looked up
    srdf: Path | None  # its SRDF, if it has one


def described_names() -> tuple[str, ...]:
    """Return the names of all robots with a URDF; empty without the package."""
    if find_spec(PACKAGE) is None:
        return ()
    known = import_module(PACKAGE).DESCRIPTIONS
    return tuple(name for name, about in known.items() if about.has_urdf)


def find_described(name: str) -> Described:
    """Return the files of a robot; its repository is cloned if it is not yet there."""
    if find_spec(PACKAGE) is None:
        raise RobotNotFoundError(
            f"robot {name!r} is described by the package {PACKAGE}: "
            f"pip install {PACKAGE}"
        )
    known = described_names()
    if name not in known:
        raise RobotNotFoundError(
            f"{PACKAGE} has no URDF of {name!r}{did_you_mean(name, known)} "
            f"(it has {listing(known)})"
        )
    try:
        with redirect_stdout(sys.stderr):  # it says there what it clones
            module = import_module(f"{PACKAGE}.{name}")
    except Exception as error:  # of git, or of a repository that has moved
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotNotFoundError(
            f"{PACKAGE} cannot fetch {name!r}: {reason}"
        ) from error
    own = vars(module)
    package, repository = Path(own["PACKAGE_PATH"]), Path(own["REPOSITORY_PATH"])
    file = Path(own.get("URDF_PATH") or own["XACRO_PATH"])
    others = own.get("XACRO_PACKAGE_PATHS", {}).values()
    folders = (package, repository, package.parent, repository.parent, file.parent)
    return Described(
        file,
        {key: str(value) for key, value in own.get("XACRO_ARGS", {}).items()},
        tuple(dict.fromkeys([*folders, *(Path(other).parent for other in others)])),
        Path(own["SRDF_PATH"]) if "SRDF_PATH" in own else None,
    )
