"""What all tests share: derandomised property tests, and signals that arrive."""

import os
import signal
from collections.abc import Generator
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

SYSTEM = Path(__file__).parent / "system"


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(
    items: list[pytest.Item],
) -> Generator[None, None, None]:
    """Say which tests are for `make test-system`, and begin with the slow files.

    These are all of tests/system, and what starts processes or a browser elsewhere, but
    for what is marked as smoke.
    """
    for item in items:
        outside = SYSTEM in item.path.parents or any(
            map(item.get_closest_marker, ("process", "browser"))
        )
        if outside and not item.get_closest_marker("smoke"):
            item.add_marker("system")
    yield  # others choose, and shuffle
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
