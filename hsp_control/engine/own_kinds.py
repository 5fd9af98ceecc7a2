"""A user's own kinds: a file in C++, compiled once, and its kinds.

Its last line lists its kinds:

    extern "C" auto hsp_kinds_1() { return hsp::kinds<ElbowHeight>(); }
"""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from types import SimpleNamespace

from hsp_control.common.errors import EngineError
from hsp_control.engine._engine import Kind, load_library

_LOADED: dict[Path, SimpleNamespace] = {}


def include_folders() -> list[Path]:
    """Return the folders of the headers: the engine's, Eigen's and Boost's.

    Raises:
        EngineError: If Eigen's or Boost's are missing.
    """
    package = Path(__file__).parent / "include"
    own = package if package.is_dir() else Path(__file__).parents[2] / "engine/include"
    prefix = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/include"
    folders = [own, prefix / "eigen3", prefix]
    for header in ("Eigen/Dense", "boost/pfr/core.hpp"):
        if not any((folder / header).is_file() for folder in folders):
            raise EngineError(
                f"the header {header} is missing: pip install 'hsp_control[engine]'"
            )
    return folders


def command(source: Path, library: Path) -> list[str]:
    """Return the command that compiles a file into a library.

    The compiler is that of the variable CXX, or the first on the path of c++, g++ and
    clang++, or the package ziglang.

    Raises:
        EngineError: If there is none.
    """
    given = os.environ.get("CXX")
    found = next(filter(shutil.which, ("c++", "g++", "clang++")), None)
    if given or found:
        compiler = shlex.split(given or str(found))
    else:
        try:
            import ziglang  # noqa: F401
        except ImportError:
            raise EngineError(
                f"no C++ compiler is there to compile {source.name}: install one "
                "(Debian: apt install g++), name it in CXX, or pip install ziglang"
            ) from None
        # By default, zig uses every instruction of this processor.
        compiler = [sys.executable, "-m", "ziglang", "c++", "-mcpu=baseline"]
    # The engine's own flags: alignment is part of Eigen's layout, and follows from the
    # processor's instructions.
    flags = ["-std=c++20", "-O2", "-DNDEBUG", "-shared", "-fPIC"]
    folders = include_folders()
    if sys.platform == "linux":
        flags.append(f"-Wl,--version-script={folders[0] / 'hsp/exports.map'}")
    headers = [f"-I{folder}" for folder in folders]
    return [*compiler, *flags, *headers, str(source), "-o", str(library)]


def build(source: str | os.PathLike[str], library: Path | None = None) -> Path:
    """Compile a file with kinds, and return the library.

    Args:
        source: The file in C++.
        library: The library to write; by default beside the file, where `load` finds
        it, also on a computer without a compiler.

    Raises:
        EngineError: If it does not compile, with the compiler's message, or there is no
        compiler.
    """
    path = Path(source)
    library = library or path.with_suffix(".so")
    library.parent.mkdir(parents=True, exist_ok=True)
    fresh = library.with_suffix(f".{os.getpid()}")
    compiling = command(path, fresh)
    try:
        made = subprocess.run(compiling, capture_output=True, text=True, check=False)
    except OSError as error:
        raise EngineError(f"the C++ compiler does not start: {error}") from None
    if made.returncode:
        raise EngineError(f"{path} does not compile:\n{made.stderr.strip()}")
    return fresh.replace(library)


def load(file: str | os.PathLike[str]) -> SimpleNamespace:
    """Return the kinds of a library, or of a file in C++, by name.

    A file is compiled unless a library beside it is newer; the result is stored in the
    user's cache folder, and is compiled again after a change of the file or the engine.

    Raises:
        EngineError: If there is no such file, or it declares no kinds.
    """
    path = Path(file).resolve()
    if not path.is_file():
        raise EngineError(f"there is no file {path}")
    if path.suffix != ".so":
        path = _library(path)
    if path not in _LOADED:
        try:
            kinds = load_library(str(path))
        except RuntimeError as error:
            raise EngineError(f"{path.name} declares no kinds: {error}") from None
        names = [kind.name for kind in kinds]
        for name in names:
            if names.count(name) > 1:
                raise EngineError(f"{path.name} declares two kinds named {name}")
        _LOADED[path] = SimpleNamespace(**dict(zip(names, kinds, strict=True)))
    return _LOADED[path]


def library_of(kind: Kind) -> str:
    """Return the library that a kind was loaded from.

    Raises:
        ValueError: If there is none.
    """
    if library := library_of_own(kind):
        return library
    raise ValueError(f"{kind.name} is no kind that `load` returned")


def library_of_own(kind: Kind) -> str:
    """Return the library that a kind was loaded from; empty for the engine's own."""
    for path, kinds in _LOADED.items():
        if vars(kinds).get(kind.name) is kind:
            return str(path)
    return ""


def of_library(library: str, name: str) -> Kind:
    """Return a kind of a library by name, for pickles.

    Raises:
        EngineError: If there is no such library, or it has no such kind.
    """
    try:
        found: Kind = vars(load(library))[name]
    except KeyError:
        raise EngineError(f"{library} has no kind {name}") from None
    return found


def _library(source: Path) -> Path:
    """Return the library of a file, compiled if need be."""
    beside = source.with_suffix(".so")
    if beside.is_file() and beside.stat().st_mtime >= source.stat().st_mtime:
        return beside
    told = hashlib.sha256(source.read_bytes())
    for header in sorted(include_folders()[0].rglob("*.hpp")):
        told.update(header.read_bytes())
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = f"{source.stem}-{told.hexdigest()[:16]}.so"
    library = Path(caches) / "hsp_control" / name
    return library if library.is_file() else build(source, library)
