"""What all tests share: derandomised property tests, and signals that arrive."""

import signal
from importlib.util import find_spec

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
