"""Machine code on disk: fresh after any edit but that of what it was made of."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from llvmlite.binding import get_host_cpu_features

import hsp_control as hsp
from hsp_control.compiled.kernel_cache import shipped_processor

pytestmark = pytest.mark.process

KERNELS = """
import numpy as np
from hsp_control.compiled import adapters
from hsp_control.compiled.linalg import multiply
from hsp_control.compiled.step_plan import bind
from hsp_control.law.pseudo_inverse import apply_pseudo_inverse

out, part = np.zeros(2), np.zeros(2)
multiply(3.0 * np.eye(2), np.ones(2), out)
assert (out == 3.0).all(), out
apply_pseudo_inverse(np.eye(2), np.eye(2), np.eye(2), 0, np.ones(2), part, out)
bind(apply_pseudo_inverse, np.eye(2), np.eye(2), np.eye(2), 0, part, part, out)()
loaded = [sum(k.stats.cache_hits.values()) for k in (multiply, apply_pseudo_inverse)]
print(*loaded, adapters._codes[-1].cache_hits)
"""
"""Says what of three was loaded: a kernel, one that calls it, and its adapter."""

COMPILED, LOADED = "0 0 0", "1 1 1"

ONE_KERNEL = """
import numpy as np
from hsp_control.compiled.linalg import multiply

multiply(np.eye(2), np.ones(2), np.zeros(2))
print(sum(multiply.stats.cache_hits.values()))
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """Return a copy of the package that may be edited."""
    root = tmp_path / "site-packages"
    ignored = shutil.ignore_patterns("__pycache__", "data")
    package = Path(hsp.__file__).parent
    shutil.copytree(package, root / "hsp_control", ignore=ignored)
    return root


@pytest.fixture
def read_only(installed: Path) -> Iterator[Path]:
    """Return the package as a system-wide installation has it: nobody writes there."""
    folders = [installed, *(path for path in installed.rglob("*") if path.is_dir())]
    for folder in folders:
        # Where tests run as root permissions bind nobody; but no cache folder can be
        # made where a file has its name.
        (folder / "__pycache__").touch()
        folder.chmod(0o555)
    yield installed
    for folder in folders:
        folder.chmod(0o755)


def run(
    root: Path, code: str = ONE_KERNEL, **environment: str
) -> "subprocess.CompletedProcess[str]":
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("NUMBA_", "XDG_")) and name != "HOME"
    }
    return subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={**kept, "PYTHONPATH": str(root), **environment},
        capture_output=True,
        text=True,
        timeout=240,
    )


def loaded(root: Path) -> str:
    ran = run(root, KERNELS)
    assert ran.stderr == ""
    return ran.stdout.strip()


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


@pytest.mark.system
def test_only_an_edit_of_what_it_is_made_of_compiles_again(installed: Path) -> None:
    package = installed / "hsp_control"
    assert loaded(installed) == COMPILED
    assert loaded(installed) == LOADED
    # Whatever is neither a kernel nor read by one.
    control = package / "control" / "controller.py"
    control.write_text(control.read_text() + "\n# A comment.\n")
    version = package / "common" / "version.py"
    version.write_text(version.read_text() + '"""Another."""\n')
    # Comments, docstrings and lines that move, in the kernels' own files as well.
    linalg = package / "compiled" / "linalg.py"
    linalg.write_text("# A comment.\n\n" + linalg.read_text())
    inverse = package / "law" / "pseudo_inverse.py"
    edit(inverse, '"""Write J# x =', '"""Write the product J# x =')
    os.utime(package / "law" / "law.py", (0, 0))
    assert loaded(installed) == LOADED
    # A kernel that is called from another file.
    edit(linalg, "out[i] = total", "out[i] = total + 0.0")
    assert loaded(installed) == COMPILED
    assert loaded(installed) == LOADED
    # A constant that a kernel reads from another file: not that of `multiply`.
    metric = package / "law" / "samples.py"
    edit(
        metric,
        "IDENTITY, CONSTANT, VARYING = 0, 1, 2",
        "IDENTITY, CONSTANT, VARYING = 0, 1, 3",
    )
    assert loaded(installed) == LOADED
    edit(
        metric,
        "IDENTITY, CONSTANT, VARYING = 0, 1, 3",
        "IDENTITY, CONSTANT, VARYING = -1, 1, 2",
    )
    assert loaded(installed) == "1 0 0"


def test_a_read_only_installation_keeps_its_code_in_the_user_s_cache(
    read_only: Path, tmp_path: Path
) -> None:
    home = tmp_path / "home"
    first = run(read_only, HOME=str(home))
    assert (first.stdout.strip(), first.stderr) == ("0", "")
    kept = list((home / ".cache" / "numba").rglob("linalg.multiply-*.nbc"))
    assert len(kept) == 1
    second = run(read_only, HOME=str(home))
    assert (second.stdout.strip(), second.stderr) == ("1", "")
    assert not list(read_only.rglob("*.nb?"))


@pytest.mark.system
def test_the_machine_code_of_a_wheel(installed: Path, tmp_path: Path) -> None:
    """It is used where nothing else is kept, and only for what it was made of."""
    name, needed = shipped_processor()
    if not all(map(get_host_cpu_features().get, needed)):
        pytest.skip("this processor lacks what wheels expect")
    made = tmp_path / "made"
    processor = {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""}
    run(installed, KERNELS, NUMBA_CACHE_DIR=str(made), **processor)
    shipped = installed / "machine_code"
    shipped.mkdir()
    for file in made.rglob("*.nb?"):
        shutil.copy(file, shipped)
    before = sorted(shipped.iterdir())

    def without_other_code(folder: str) -> str:
        return run(installed, KERNELS, NUMBA_CACHE_DIR=str(tmp_path / folder)).stdout

    assert without_other_code("empty").strip() == LOADED
    linalg = installed / "hsp_control" / "compiled" / "linalg.py"
    edit(linalg, "out[i] = total", "out[i] = total + 0.0")
    assert without_other_code("still empty").strip() == COMPILED
    assert sorted(shipped.iterdir()) == before


def test_where_the_disk_is_full_it_still_runs_and_says_so(
    installed: Path, tmp_path: Path
) -> None:
    full = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (100, 100))\n"
    ran = run(installed, full + KERNELS, NUMBA_CACHE_DIR=str(tmp_path / "full"))
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip() == COMPILED
    assert "compiled code cannot be kept" in ran.stderr


def test_where_nothing_can_be_written_it_still_runs_and_says_so(
    read_only: Path,
) -> None:
    ran = run(read_only, HOME="/proc/nowhere")
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr.count("compiled code cannot be kept") == 1
    assert "NUMBA_CACHE_DIR" in ran.stderr
