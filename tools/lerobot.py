"""Make an environment for LeRobot and our plugin, and run its tests: `make lerobot`.

The plugin needs nothing of hsp_control, so the environment has none of it: the loops
that the tests start run in .venv. PyPI's PyTorch for Linux brings CUDA, 8 GB in all;
with PIP_EXTRA_INDEX_URL pip finds a build for CPUs alone.

Run it with the Python of .venv-lerobot; arguments are pytest's.
"""

import os
import subprocess
import sys
from pathlib import Path

PLUGIN = Path(__file__).resolve().parent.parent / "plugins" / "lerobot_robot_hsp"
LEROBOT = f"lerobot{'[dataset]==0.6.1' if sys.version_info > (3, 12) else '==0.4.4'}"


def main() -> int:
    """Install everything, and return the exit code of the tests."""
    own = {key: value for key, value in os.environ.items() if key != "PIP_CONSTRAINT"}
    command = [sys.executable, "-m", "pip", "install", "--quiet", LEROBOT]
    command += ["--editable", str(PLUGIN), "pytest>=8", "pytest-timeout"]
    subprocess.run(command, check=True, env=own)
    tests = [sys.executable, "-m", "pytest", "--rootdir", str(PLUGIN)]
    return subprocess.run([*tests, *sys.argv[1:]], cwd=PLUGIN, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
