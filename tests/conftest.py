"""What all tests share: derandomised property tests, and signals that arrive."""

import gc
import os
import signal
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

# A quarter of Hypothesis' own number of examples, but for `make thorough`.
EXAMPLES = 100 if os.environ.get("HSP_THOROUGH") else 25
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


def pytest_collection_finish() -> None:
    """Take what the tests are made of out of the garbage collector's sight.

    A loop collects garbage before it begins: among a million objects of 8000 tests that
    takes longer than most runs.
    """
    gc.collect()
    gc.freeze()


def pytest_sessionfinish() -> None:
    """Show the collector all of it again: what an end leaves is said as leaked."""
    gc.unfreeze()


SYSTEM = Path(__file__).parent / "system"


@pytest.hookimpl(tryfirst=True)  # others choose by it
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Say which tests are for `make test-system`.

    These are all of tests/system, and what starts processes or a browser elsewhere, but
    for what is marked as smoke.
    """
    for item in items:
        outside = SYSTEM in item.path.parents or any(
            map(item.get_closest_marker, ("process", "browser"))
        )
        if outside and not item.get_closest_marker("smoke"):
            item.add_marker("system")
