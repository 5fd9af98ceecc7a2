"""``hsp doctor``: checks this machine for a fast and punctual loop."""

import argparse
import json
import os
import platform
import resource
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Literal, NamedTuple

from packaging.requirements import Requirement

from hsp_control.cli.consoles import out
from hsp_control.common.entry_points import entry_points
from hsp_control.common.version import __version__

_PACKAGE = "hsp_control"
_SHOWN = ("pin", "numpy", "scipy", "pydantic", "meshcat")
_OURS = {"test", "dev", "docs"}
"""Extras for those who develop the package."""


class Check(NamedTuple):
    """A check and its result."""

    topic: str  # the topic
    # ``ok``; ``note``: something is slower, later or missing; ``bad``: something does
    # not work
    state: Literal["ok", "note", "bad"]
    found: str  # the finding
    advice: str = ""  # the remedy


def doctor(options: argparse.Namespace) -> int:
    """Print the results; return 2 if something does not work."""
    checks = [
        *_versions(),
        _dynamics(),
        _threads(),
        *_companions(),
        *_real_time(),
        *_extras(),
    ]
    if options.json:
        print(json.dumps([each._asdict() for each in checks], indent=2))
    else:
        for each in checks:
            sign = {"ok": " ", "note": "-", "bad": "!"}[each.state]
            out.print(f"{sign} {each.topic:16} {each.found}", markup=False)
            if each.advice:
                out.print(f"  {'':16} {each.advice}", markup=False)
    return 2 if any(each.state == "bad" for each in checks) else 0


def _versions() -> Iterator[Check]:
    python = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield Check("Python", "ok", python)
    if (installed := metadata.version(_PACKAGE)) == __version__:
        yield Check(_PACKAGE, "ok", __version__)
    else:
        yield Check(
            _PACKAGE,
            "note",
            f"{__version__}, installed as {installed}",
            "install it again: its extras and plugins are those of the old version",
        )
    found = ", ".join(f"{name} {metadata.version(name)}" for name in _SHOWN)
    yield Check("with", "ok", found)


def _dynamics() -> Check:
    """Report the Pinocchio that loads models, and the compiled one."""
    from pinocchio import __version__ as loads

    from hsp_control.engine import PINOCCHIO

    return Check("Pinocchio", "ok", f"{loads} loads models, {PINOCCHIO} steps them")


def _threads() -> Check:
    """Check whether BLAS would start threads for small matrices."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")  # the first one is used
    given = {name: os.environ[name] for name in names if name in os.environ}
    used = (value for value in given.values() if value.isdecimal() and int(value))
    if next(used, "") == "1":
        return Check("BLAS threads", "ok", "1")
    said = ", ".join(f"{name}={value}" for name, value in given.items())
    return Check(
        "BLAS threads",
        "note",
        said or f"not set: as many as processors ({os.cpu_count()})",
        "OPENBLAS_NUM_THREADS=1 keeps a loop's period: the matrices are small",
    )


def _companions() -> Iterator[Check]:
    """Run the checks of companions, entry points of ``hsp_control.checks``."""
    for _, entry in sorted(entry_points("checks").items()):
        check: Callable[[], Check] = entry.load()
        yield check()


def _real_time() -> Iterator[Check]:
    """Check the kernel, the permission for real-time priority, and the clock."""
    if platform.system() != "Linux":
        return
    preempt = "PREEMPT_RT" in platform.version() or _is("/sys/kernel/realtime", "1")
    yield Check(
        "kernel",
        "ok" if preempt else "note",
        platform.release() + (" with PREEMPT_RT" if preempt else ""),
        "" if preempt else "a robot at 1 kHz wants PREEMPT_RT (docs/latency.md)",
    )
    most = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    allowed = os.geteuid() == 0 or most == resource.RLIM_INFINITY or most > 0
    yield Check(
        "real-time rights",
        "ok" if allowed else "note",
        "real-time priority is permitted" if allowed else "no real-time priority",
        "" if allowed else "a line 'rtprio' in /etc/security/limits.conf permits it",
    )
    governor = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    if governor.is_file():
        name = governor.read_text().strip()
        fast = name == "performance"
        yield Check(
            "clock",
            "ok" if fast else "note",
            f"governor {name}",
            "" if fast else "'performance' keeps the clock up (cpupower frequency-set)",
        )


def _is(file: str, text: str) -> bool:
    path = Path(file)
    return path.is_file() and path.read_text().strip() == text


def _extras() -> Iterator[Check]:
    """Check which extras are installed."""
    wanted: dict[str, list[Requirement]] = {}
    for line in metadata.requires(_PACKAGE) or ():
        requirement = Requirement(line)
        if requirement.marker is None or requirement.name.replace("-", "_") == _PACKAGE:
            continue
        for extra in set(metadata.metadata(_PACKAGE).get_all("Provides-Extra") or ()):
            here = requirement.marker.evaluate({"extra": extra})
            if here and not requirement.marker.evaluate({"extra": ""}):
                wanted.setdefault(extra, []).append(requirement)
    for extra in sorted(wanted.keys() - _OURS):
        missing = [each.name for each in wanted[extra] if not _installed(each)]
        yield Check(
            f"extra {extra}",
            "note" if missing else "ok",
            f"not installed: {', '.join(missing)}" if missing else "installed",
            f"pip install '{_PACKAGE}[{extra}]'" if missing else "",
        )


def _installed(requirement: Requirement) -> bool:
    try:
        version = metadata.version(requirement.name)
    except metadata.PackageNotFoundError:
        return False
    return requirement.specifier.contains(version, prereleases=True)
