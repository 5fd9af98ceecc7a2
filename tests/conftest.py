"""What all tests share: derandomised property tests, and signals that arrive."""

import signal
from importlib.util import find_spec

import pytest
from hypothesis import settings

settings.register_profile("proof", derandomize=True, deadline=None)
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


@pytest.hookimpl(trylast=True)  # after the shuffle of pytest-randomly
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files with browsers and processes before the many small ones.

    Workers take files in this order (`--no-loadscope-reorder`). With one of these files
    last, one worker would wait for the other for minutes. Integration tests come first:
    they compile what the other processes then find.
    """
    long = ("browser", "process")
    slow = {item.path for item in items if any(map(item.get_closest_marker, long))}

    def place(item: pytest.Item) -> int:
        if item.path in slow:
            return 1
        return 0 if item.path.parent.name == "integration" else 2

    items.sort(key=place)
