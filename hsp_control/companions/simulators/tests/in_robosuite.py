"""Make an environment for robosuite, and run its tests there: `make sims`.

robosuite 1.5.2 does not work with MuJoCo 4. It requires mink 0.0.5, which requires
NumPy 1; no arm controller needs either. So it is installed without its requirements,
and those that it imports are installed separately.

Run it with the Python of .venv-sims; arguments are pytest's.
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
ALONE = ["robosuite==1.5.2"]
BESIDE = ["mujoco==3.3.7", "opencv-python-headless", "pillow", "termcolor", "tqdm"]
TESTS = ["hypothesis", "pytest>=8", "pytest-timeout"]


def pip(*arguments: str) -> None:
    """Install into this environment; our constraints have another MuJoCo."""
    own = {key: value for key, value in os.environ.items() if key != "PIP_CONSTRAINT"}
    command = [sys.executable, "-m", "pip", "install", "--quiet", *arguments]
    subprocess.run(command, check=True, env=own)


def main() -> int:
    """Install everything, and return the exit code of the tests."""
    pip("--editable", str(ROOT), *BESIDE, *TESTS)
    pip("--no-deps", *ALONE)
    command = [sys.executable, "-m", "pytest", "-W", "ignore", str(HERE)]
    return subprocess.run([*command, *sys.argv[1:]], cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
