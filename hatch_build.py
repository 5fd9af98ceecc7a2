"""Builds the engine, the compiled part of the package, into ``hsp_control/engine``.

pip runs it (the hook of the wheel, also of an editable one), and ``make`` where a
source is newer than the library: ``python hatch_build.py``. A C++ compiler is taken
from the variable CXX or from the path; where there is none, or CXX is ``zig``, it is
the package ziglang. Its library runs on any Linux of the last ten years, as the wheel's
tag declares. With Python 3.12 or newer the library keeps to Python's stable ABI, and
one wheel serves 3.12 and all later ones.
"""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
    from packaging.tags import sys_tags  # hatchling brings it
except ImportError:  # `make` needs no hook
    BuildHookInterface = object

ROOT = Path(__file__).parent

ZIG_TARGETS = {"x86_64": "x86_64-linux-gnu.2.17", "aarch64": "aarch64-linux-gnu.2.17"}
"""The targets of zig by machine: any processor, and glibc from 2.17 on. Without a
target it would compile for the processor that it runs on."""
OLD_LINUX = "manylinux_2_17"
"""The name of this platform in a wheel's tag."""


def compiler() -> str | None:
    """Return the machine's own C++ compiler; None: zig is requested, or stands in."""
    given = os.environ.get("CXX")
    if given == "zig":
        return None
    return given or next(filter(shutil.which, ("c++", "g++", "clang++")), None)


def has_cmake() -> bool:
    """Return whether the machine's own CMake will do.

    One before 3.26 (Debian 12, Ubuntu 22.04) does not find Python's stable ABI, which
    exists from Python 3.12 on: its libraries work, but for one Python version only.
    """
    if sys.version_info < (3, 12) or not shutil.which("cmake"):
        return bool(shutil.which("cmake"))
    said = subprocess.run(
        ["cmake", "--version"], capture_output=True, text=True, check=True
    )
    version = said.stdout.split()[2]
    return tuple(map(int, version.split(".")[:2])) >= (3, 26)


def tools() -> list[str]:
    """Return the packages that stand for tools which this machine lacks."""
    found = [] if has_cmake() else ["cmake>=3.26"]
    found += [] if shutil.which("ninja") else ["ninja"]
    return found if compiler() else [*found, "ziglang"]


def needs() -> list[str]:
    """Return all packages that a build takes."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return [*project["build-system"]["requires"], "editables", *tools()]


def zig(folder: Path) -> list[str]:
    """Return CMake's options for zig as compiler and archiver."""
    machine = platform.machine()
    if machine not in ZIG_TARGETS:
        raise SystemExit(
            f"hsp_control needs a C++ compiler, and this machine ({machine}) has none: "
            "install one (Debian: apt install g++), or name it in CXX"
        )
    options = []
    for name, tool in (("CXX_COMPILER", "c++"), ("AR", "ar"), ("RANLIB", "ranlib")):
        # zig's default -g takes a quarter longer, and objects fifty times the size.
        target = f"-target {ZIG_TARGETS[machine]} -g0" if tool == "c++" else ""
        script = folder / f"zig-{tool}"
        script.write_text(
            f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {tool} {target} "$@"\n'
        )
        script.chmod(0o755)
        options.append(f"-DCMAKE_{name}={script}")
    return options


@contextmanager
def alone(place: Path) -> Iterator[None]:
    """Wait until no other process builds in a folder; it finds little left to do."""
    try:
        from fcntl import LOCK_EX, flock
    except ImportError:  # Windows
        yield
        return
    with (place / ".lock").open("w") as lock:
        flock(lock, LOCK_EX)
        yield


def build(kind: str = "Release", folder: Path = ROOT / "build") -> Path:
    """Build the library, and return where it is.

    Args:
        kind: ``Release``: it is put beside the Python of the engine; ``Debug``, with
            Eigen's assertions, and ``Sanitized`` stay where they are compiled.
        folder: Folder of compiled files, by Python version and kind of build.
    """
    by = "" if compiler() else "-zig"
    place = folder / f"{kind}-{sysconfig.get_config_var('SOABI')}{by}".lower()
    place.mkdir(parents=True, exist_ok=True)
    with alone(place):
        return _built(kind, place)


def _built(kind: str, place: Path) -> Path:
    """Build in a folder that is ours alone."""
    # The cache may refer to a build environment that was removed.
    (place / "CMakeCache.txt").unlink(missing_ok=True)
    options = [f"-DCMAKE_BUILD_TYPE={kind}", f"-DPython_EXECUTABLE={sys.executable}"]
    if compiler() is None:
        options += zig(place)
    configure = ["cmake", "-G", "Ninja", "-S", str(ROOT / "engine"), "-B", str(place)]
    # Tools that pip brought are beside Python.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    environment = os.environ | {"PATH": path}
    if compiler() is None:
        environment.pop("CXX", None)
    make = ["cmake", "--build", str(place)]
    for command in ([*configure, *options], make):
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment
        )
        if done.returncode:
            sys.stderr.write(done.stdout + done.stderr)
            raise SystemExit(f"the engine was not built: {' '.join(command)} failed")
    (library,) = place.glob("_engine*.so")
    if kind != "Release":
        return library
    target = ROOT / "hsp_control" / "engine" / library.name
    # Python loads a library named for it alone before one of the stable ABI.
    for suffix in EXTENSION_SUFFIXES:
        preferred = target.with_name(f"_engine{suffix}")
        if preferred == target:
            break
        preferred.unlink(missing_ok=True)
    (step,) = place.glob("libhsp_step.*")
    _put(step, target.with_name(step.name))
    return _put(library, target)


def _put(library: Path, target: Path) -> Path:
    """Copy a library to a new file: who has loaded the old one goes on with it."""
    fresh = target.with_suffix(".new")
    shutil.copy2(library, fresh)
    return fresh.replace(target)


def wheel_tag(library: str) -> str:
    """Return the tag of a wheel with this library: Python, its ABI and the platform.

    Args:
        library: The library's file name, in which CMake marks whether it keeps to the
            stable ABI, which begins with Python 3.12 (nanobind needs no less).
    """
    # This Python's tags, the best first; a library linked against those of this machine
    # may not be tagged manylinux.
    mine = next(
        tag for tag in sys_tags() if not tag.platform.startswith(("many", "musl"))
    )
    python = "cp312-abi3" if ".abi3." in library else f"{mine.interpreter}-{mine.abi}"
    zig_made = f"{OLD_LINUX}_{platform.machine()}"
    return f"{python}-{mine.platform if compiler() else zig_made}"


def configs_of_companions() -> dict[str, str]:
    """Return where a wheel has the configurations of companions: beside others."""
    return {
        str(file): f"hsp_control/data/configs/{file.relative_to(folder)}"
        for folder in sorted(ROOT.glob("hsp_control/companions/*/configs"))
        for file in sorted(folder.rglob("*.yaml"))
    }


class EngineHook(BuildHookInterface):  # type: ignore[misc]
    """Builds the engine where a wheel is built, also an editable one."""

    def dependencies(self) -> list[str]:
        """Return the requirements besides those of pyproject.toml."""
        return tools()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build; the wheel is then one of this machine and of some Pythons."""
        library = build()
        build_data["pure_python"] = False
        build_data["tag"] = wheel_tag(library.name)
        for each in (library, *library.parent.glob("libhsp_step.*")):
            build_data["artifacts"].append(str(each.relative_to(ROOT)))
        if version == "standard":  # an editable one reads the checkout
            build_data["force_include"] |= configs_of_companions()


if __name__ == "__main__":
    if sys.argv[1:] == ["needs"]:
        print(" ".join(needs()))
    else:
        print(build(*sys.argv[1:]))
