"""The engine's library: the installed one, or that of HSP_ENGINE."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hsp_control.engine import _engine

WHICH = """
import sys

import hsp_control.engine as engine
import numpy as np
x, y = np.ones(1), np.zeros(1)
engine.Copy(x=x, out=y)()
print(sys.modules["hsp_control.engine._engine"].__file__, y[0])
"""


def requested(library: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WHICH],
        env=os.environ | {"HSP_ENGINE": str(library)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.process
def test_another_library_is_used_instead(tmp_path: Path) -> None:
    other = Path(shutil.copy2(_engine.__file__, tmp_path / "_engine.so"))
    assert requested(other).stdout.split() == [str(other), "1.0"]


@pytest.mark.process
def test_a_library_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    ran = requested(tmp_path / "nowhere.so")
    assert ran.returncode != 0
    assert "nowhere.so" in ran.stderr
