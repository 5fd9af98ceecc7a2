"""Setup of all tests: derandomised property tests, and signals that arrive.

Tests of the core are in `tests`, those of a companion in its folder, with shared code
in `tests/support` there. A file of tests that needs a removed companion is not
collected.
"""

import gc
import os
import re
import signal
import sys
from functools import cache, wraps
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

# A tenth of Hypothesis' own number of examples, but for `make thorough`.
EXAMPLES = 100 if os.environ.get("HSP_THOROUGH") else 10
settings.register_profile(
    "proof", derandomize=True, deadline=None, max_examples=EXAMPLES
)
settings.load_profile("proof")

# A shell may start the tests with these ignored (in the background, under nohup), which
# every process that they start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# These have no wheels for every Python that we run on.
collect_ignore_glob = [
    tests
    for package, tests in (("cyclonedds", "*ros2*"), ("pylibfranka", "*franka*"))
    if find_spec(package) is None
]


ROOT = Path(__file__).parent
COMPANIONS = ROOT / "hsp_control" / "companions"
SUPPORT = sorted(COMPANIONS.glob("*/tests/support"))
sys.path += map(str, SUPPORT)

gc.disable()  # during the collection of tests, whose objects are all kept


def pytest_collection_finish() -> None:
    """Exclude the tests' own objects from garbage collection.

    A loop collects garbage before it begins: among a million objects of 8000 tests that
    takes longer than most runs.
    """
    gc.collect()
    gc.freeze()
    gc.enable()
    frozen = gc.get_freeze_count()

    # Counting half a million objects takes 50 ms, at the start of every loop.
    @wraps(gc.get_freeze_count)
    def known() -> int:
        return frozen

    gc.get_freeze_count = known


def pytest_sessionfinish() -> None:
    """Include them again: objects that remain at the end are reported as leaked."""
    gc.unfreeze()


SYSTEM = ROOT / "tests" / "system"
STARTS_OTHERS = re.compile(r"mark\.(process|browser|system)\b")
IMPORTED = re.compile(
    r"^(?:from|import) (?:hsp_control\.companions\.(\w+)|(\w+)(?: import|$))",
    re.MULTILINE,
)


@cache
def may_be_of_the_system(file: Path) -> bool:
    """Return whether a file of tests can have those of `make test-system`."""
    return SYSTEM in file.parents or bool(STARTS_OTHERS.search(file.read_text("utf-8")))


@cache
def needed(file: Path) -> frozenset[str]:
    """Return the companions that a file of tests imports, also by its helpers."""
    found = IMPORTED.findall(file.read_text("utf-8"))
    folders = [ROOT / "tests" / "support", *SUPPORT]
    helpers = [folder / f"{name}.py" for _, name in found if name for folder in folders]
    theirs = (needed(helper) for helper in helpers if helper.is_file())
    return frozenset(name for name, _ in found if name).union(*theirs)


def taken_away(companion: str) -> bool:
    """Return whether neither a folder nor a file of this name is among companions."""
    folder = COMPANIONS / companion
    return not (folder.is_dir() or folder.with_suffix(".py").is_file())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file for `make test-system` that has nothing for it: most have not.

    And none that imports a companion which was taken away.
    """
    if collection_path.suffix != ".py":
        return None
    if config.option.markexpr == "system" and not may_be_of_the_system(collection_path):
        return True
    return True if any(map(taken_away, needed(collection_path))) else None


@pytest.hookimpl(tryfirst=True)  # others choose by it
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of `make test-system`.

    These are all of tests/system, and tests elsewhere that start processes or a
    browser, except those marked as smoke.
    """
    for item in items:
        outside = SYSTEM in item.path.parents or any(
            map(item.get_closest_marker, ("process", "browser"))
        )
        if outside and not item.get_closest_marker("smoke"):
            item.add_marker("system")
        if item.get_closest_marker("system") and not may_be_of_the_system(item.path):
            raise pytest.UsageError(
                f"{item.path} has tests for `make test-system`, which would not find "
                f"them: the file itself must contain {STARTS_OTHERS.pattern}"
            )
