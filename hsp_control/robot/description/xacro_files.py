"""Expand xacro, the macro language of URDFs, where the package ``xacro`` is installed.

A xacro file is a program: it includes other files and evaluates Python expressions.
The folders that ``package://`` and $(find) mean are found without ROS.
"""

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hsp_control.common.errors import ModelError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.suggestions import did_you_mean
from hsp_control.robot.description.access import MAX_SIZE, XmlError, read_xml


def package_folders(package: str, folders: Iterable[Path]) -> list[Path]:
    """Return the folders that may be a package; the first existing one is meant."""
    places = [*folders, *_of_environment()]
    return [
        *(place / package for place in places),
        *(place for place in places if package in (place.name, _declared_name(place))),
    ]


def _of_environment() -> list[Path]:
    ros = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [
        *(Path(folder) for folder in ros if folder),
        *(Path(folder) / "share" for folder in ament if folder),
    ]


def _declared_name(folder: Path) -> str | None:
    """Return the name in a folder's package.xml: a clone may be called otherwise."""
    try:
        return read_xml(folder / "package.xml").findtext("name")
    except (OSError, ValueError, XmlError):  # none, or a path that can be none
        return None


_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)  # xacro leaves its own as comments
_MACRO = re.compile(rb"<xacro:\w")


def is_xacro(file: Path) -> bool:
    """Return whether a file must be expanded: by its name, or by its contents."""
    if file.suffix.lower() == ".xacro":
        return True
    try:
        check_ends(file)
        with file.open("rb") as opened:
            text = _COMMENT.sub(b"", opened.read(MAX_SIZE))
    except OSError:  # reported by the reader of the URDF
        return False
    return _MACRO.search(text) is not None


def xacro_text(value: str | bool | float) -> str:
    """Return an argument as xacro writes it: ``true``, ``7``, ``0.5``, ``left_``."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer():
        value = int(value)  # `7` is read as 7.0, but a macro may need an integer
    return str(value)


class _Asked(dict[str, str]):
    """Arguments that record the names that xacro has requested."""

    def __init__(self, arguments: Mapping[str, str]) -> None:
        super().__init__(arguments)
        self.names: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.names.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.names.add(name)
        return super().__getitem__(name)


def expand(
    file: Path,
    arguments: Mapping[str, str],
    package_dirs: Sequence[Path],
    defaults: Mapping[str, str] | None = None,
) -> str:
    """Return the URDF that a xacro file makes."""
    try:
        import xacro  # type: ignore[import-not-found,import-untyped,unused-ignore]
        from xacro import (  # type: ignore[import-not-found,import-untyped,unused-ignore]
            substitution_args,
        )
    except ImportError:
        raise ModelError(
            f"{file}: a xacro file must be expanded: pip install xacro, or expand it "
            f"first: xacro {file.name} > {_expanded_name(file)}"
        ) from None
    asked = _Asked({**(defaults or {}), **arguments})
    try:
        with _packages_found(substitution_args, package_dirs):
            document = xacro.process_file(str(file), mappings=asked)
    except Exception as error:  # expressions may raise anything
        reason = " ".join(str(error).split()) or type(error).__name__
        if type(error).__name__ == "UndefinedArgumentsException" or reason.startswith(
            "Undefined substitution argument"
        ):
            reason += "; give it by xacro_args, or on the command line as name:=value"
        raise ModelError(f"{file}: xacro cannot expand it: {reason}") from error
    for name in arguments:
        if name not in asked.names:
            raise ModelError(
                f"{file}: xacro_args: the file has no argument {name!r}"
                f"{did_you_mean(name, sorted(asked.names))}"
            )
    return str(document.toprettyxml(indent="  "))


@contextmanager
def _packages_found(
    substitution_args: Any, package_dirs: Sequence[Path]
) -> Iterator[None]:
    """Let ``$(find package)`` search folders; xacro itself uses an installed ROS 2."""

    def find(package: str) -> str:
        for folder in package_folders(package, package_dirs):
            if folder.is_dir():
                return str(folder)
        raise LookupError(
            f"no package {package!r} beside the file or above it, nor along "
            "ROS_PACKAGE_PATH"
        )

    original = substitution_args._eval_find
    evaluated = substitution_args._eval_dict
    substitution_args._eval_find = evaluated["find"] = find
    try:
        yield
    finally:
        substitution_args._eval_find = evaluated["find"] = original


def _expanded_name(file: Path) -> str:
    stem = Path(file.name.removesuffix(".xacro")).stem
    return f"{stem}.urdf" if f"{stem}.urdf" != file.name else f"{stem}_expanded.urdf"
