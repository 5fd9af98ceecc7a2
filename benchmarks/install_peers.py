"""Install this checkout and the peers into the environment that runs this script.

`make bench` calls it with .venv-peers/bin/python. Peers that cannot be installed are
written to .venv-peers/peers.json with the reason, which then stands in the table.

TSID's wheel on PyPI is built for another Pinocchio and aborts with pin 4.1. Therefore
it is built here from its source package, with a C++ compiler and about 2 GB of memory
a job. That takes 15 to 30 minutes, once; the wheels are kept in .venv-peers/wheels.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HOME = Path(sys.prefix)
WHEELS = HOME / "wheels"

PLACO_HOME, PLACO = ROOT / ".venv-placo", "placo==0.10.2"

PIN = ["pin==4.1.0", "libpinocchio==4.1.0", "cmeel-eigen==3.4.1"]
PINK = ["pin-pink==4.4.0", "daqp==0.11.0", "proxsuite==0.8.0", "quadprog==0.1.14"]
# Needed for the build and not in the wheels: CMake files, headers, `wheel pack`.
BUILD = ["libpinocchio[build]==4.1.0", "eiquadprog==1.3.2", "jrl-cmakemodules==2.1.0"]
BUILD += ["cmake<4", "cmeel", "wheel"]
CHECKS = {
    "pink": "import pink, qpsolvers; print(pink.__version__)",
    # An import of TSID is not enough: the wheel on PyPI aborts on the first robot.
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


def install_pink() -> None:
    """Install pink and its solvers with this package's version of Pinocchio."""
    pip("install", "--quiet", *PINK, *PIN)


def install_tsid() -> None:
    """Build TSID with this environment's Pinocchio, unless the wheels exist."""
    pip("install", "--quiet", *BUILD, *PIN)
    for name in ("libtsid", "tsid"):
        if not list(WHEELS.glob(f"{name}-1.10.0-*.whl")):
            print(
                f"  building {name} 1.10.0 from source (some minutes) ...", flush=True
            )
            pip(
                "wheel", "--no-deps", "--no-build-isolation", "--no-binary", name,
                "--wheel-dir", str(WHEELS), f"{name}==1.10.0",
                CMEEL_RUN_TESTS="OFF", CMEEL_JOBS="2",
            )  # fmt: skip
        wheel = next(WHEELS.glob(f"{name}-1.10.0-*.whl"))
        pip("install", "--quiet", "--no-deps", "--force-reinstall", str(wheel))


def install_placo() -> None:
    """Install placo into an environment of its own: it needs pin 3.8."""
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
    pip("install", "--quiet", "--editable", f"{ROOT}[robots,mujoco]", *PIN)
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
