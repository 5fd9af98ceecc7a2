"""What all tests share: derandomised property tests, and signals that arrive."""

import os
import signal
from importlib.util import find_spec

from hypothesis import settings

# Half of Hypothesis' own number of examples, but for `make thorough`.
EXAMPLES = 100 if os.environ.get("HSP_THOROUGH") else 50
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
