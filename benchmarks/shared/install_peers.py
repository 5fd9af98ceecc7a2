"""Install this checkout and the peers into the environment that runs this script.

`make bench` calls it with .venv-peers/bin/python. Peers that cannot be installed are
written to .venv-peers/peers.json with the reason, which then stands in the table.

TSID's wheels are built for Pinocchio 4.0, and abort with 4.1, which this one needs
for. Pinocchio's algorithms are compiled into its engine, so that another release may
load the models: all peers but placo run with 4.0.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HOME = Path(sys.prefix)
WHEELS = HOME / "wheels"

PLACO_HOME, PLACO = ROOT / ".venv-placo", "placo==0.10.2"

PIN = ["pin==4.0.0", "libpinocchio==4.0.0"]
PINK = ["pin-pink==4.4.0", "daqp==0.11.0", "proxsuite==0.8.0", "quadprog==0.1.14"]
TSID = ["tsid==1.10.0", "eiquadprog==1.3.2"]
LIBTSID = "libtsid==1.10.0"
"""TSID's C++ library, with its headers: it has no Python in it, but its wheel is for
Python 3.14 by name."""

CHECKS = {
    "pink": "import pink, qpsolvers; print(pink.__version__)",
    # An import of TSID is not enough: with another Pinocchio it aborts at a robot.
    "placo": "import placo, importlib.metadata as m; print(m.version('placo'))",
    "tsid": (
        "import pinocchio as pin, tsid; m = pin.buildSampleModelManipulator(); "
        "tsid.RobotWrapper(m, tsid.FIXED_BASE_SYSTEM, False); print('1.10.0')"
    ),
}


def run(*command: str, **environment: str) -> str:
    """Run a command, and return its output.

    Raises:
        RuntimeError: If it fails; the message has its first line with an error.
    """
    done = subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True
    )
    if done.returncode:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line]
        errors = [line for line in lines if "rror" in line] or lines or [""]
        raise RuntimeError(f"exit {done.returncode}: {errors[0].strip()[:200]}")
    return done.stdout.strip()


def pip(*arguments: str, **environment: str) -> None:
    """Run pip in this environment."""
    run(sys.executable, "-m", "pip", *arguments, **environment)


def install_package() -> None:
    """Install this checkout, with the engine that `make` has built."""
    own = [str(ROOT / ".venv" / "bin" / "python"), "-m", "pip", "wheel", "--quiet"]
    WHEELS.mkdir(exist_ok=True)
    for old in WHEELS.glob("hsp_control-*.whl"):
        old.unlink()
    run(
        *own, "--no-deps", "--no-build-isolation", "--wheel-dir", str(WHEELS),
        str(ROOT), PIP_BUILD_CONSTRAINT="",
    )  # fmt: skip
    wheel = next(WHEELS.glob("hsp_control-*.whl"))
    pip("install", "--quiet", f"{wheel}[robots,mujoco,engine]")
    pip("install", "--quiet", "--force-reinstall", "--no-deps", str(wheel))
    pip("install", "--quiet", "--no-deps", *PIN, PIP_CONSTRAINT="")


def install_pink() -> None:
    """Install pink and its solvers."""
    pip("install", "--quiet", *PINK, *PIN, PIP_CONSTRAINT="")


def install_tsid() -> None:
    """Install TSID, its library under a name that any Python accepts."""
    pip("install", "--quiet", "wheel", *TSID[1:], *PIN, PIP_CONSTRAINT="")
    if not list(WHEELS.glob("libtsid-1.10.0-*-py3-none-*.whl")):
        pip(
            "download", "--quiet", "--no-deps", "--only-binary=:all:",
            "--python-version=3.14", "--dest", str(WHEELS), LIBTSID, PIP_CONSTRAINT="",
        )  # fmt: skip
        given = next(WHEELS.glob("libtsid-1.10.0-*-cp314-*.whl"))
        tags = ["--python-tag=py3", "--abi-tag=none", "--remove", str(given)]
        run(sys.executable, "-m", "wheel", "tags", *tags)
    library = next(WHEELS.glob("libtsid-1.10.0-*-py3-none-*.whl"))
    pip("install", "--quiet", "--no-deps", str(library), *TSID, PIP_CONSTRAINT="")


def install_placo() -> None:
    """Install placo into its own environment: it needs pin 3.8."""
    if not PLACO_HOME.joinpath("bin", "python").exists():
        # Debian's Python has no ensurepip: use the pip of this environment.
        run(sys.executable, "-m", "venv", "--without-pip", str(PLACO_HOME))
    pip(
        "--python", str(PLACO_HOME / "bin" / "python"), "install", "--quiet", PLACO,
        PIP_CONSTRAINT="", PIP_BUILD_CONSTRAINT="",
    )  # fmt: skip


def main() -> None:
    """Install all peers; write the reasons of those that cannot be installed."""
    print("Installing this checkout into", HOME, flush=True)
    install_package()
    installers: dict[str, Callable[[], None]] = {
        "pink": install_pink,
        "tsid": install_tsid,
        "placo": install_placo,
    }
    report = {}
    for name, install in installers.items():
        print(f"Installing {name} ...", flush=True)
        try:
            install()
            home = PLACO_HOME if name == "placo" else HOME
            version = run(str(home / "bin" / "python"), "-c", CHECKS[name])
            report[name] = {"version": version.splitlines()[-1]}
        except RuntimeError as error:
            print(f"  {name} cannot be installed: {error}", flush=True)
            report[name] = {"failed": str(error)}
    (HOME / "peers.json").write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
