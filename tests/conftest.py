"""What all tests share: derandomised property tests without a clock."""

from hypothesis import settings

settings.register_profile("proof", derandomize=True, deadline=None)
settings.load_profile("proof")
