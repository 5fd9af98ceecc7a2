"""Paths of the library that runs frozen controllers, its header, its CMake package."""

import shlex
import sys
from pathlib import Path

from hsp_control import engine
from hsp_control.common.errors import FreezeError

_ENGINE = Path(engine.LIBRARY).parent
_PACKAGE = Path(engine.__file__).parent
_SOURCES = Path(__file__).parents[2] / "engine"


def library() -> Path:
    """Return the shared library hsp_step: of the same build as the engine in use.

    Raises:
        FreezeError: If it was not built.
    """
    ending = "dylib" if sys.platform == "darwin" else "so"
    return _there(_ENGINE / f"libhsp_step.{ending}")


def include_folder() -> Path:
    """Return the folder of ``hsp_step.h``."""
    return _folder("include", "hsp_step.h")


def compiler_flags() -> str:
    """Return the compiler's flags for a program that runs a frozen controller.

    ``cc loop.c $(hsp freeze --flags)``: the header's folder, the library, and where the
    program finds it when it runs, as ``pkg-config`` would print them.
    """
    own = library()
    flags = f"-I{include_folder()}", str(own), f"-Wl,-rpath,{own.parent}"
    return shlex.join(flags)


def cmake_folder() -> Path:
    """Return the folder that CMake's ``find_package(hsp_step)`` is given.

    ``cmake -D hsp_step_DIR=$(hsp freeze --cmake-dir)``
    """
    return _folder("cmake", "hsp_step-config.cmake")


def _folder(name: str, file: str) -> Path:
    """Return a folder of the package, or of the checkout that it is run from."""
    own = _PACKAGE / name
    return _there((own if own.is_dir() else _SOURCES / name) / file).parent


def _there(path: Path) -> Path:
    if not path.is_file():
        raise FreezeError(f"{path} is missing: install the package anew")
    return path
