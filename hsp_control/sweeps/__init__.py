"""Sweeps: run one experiment many times with different values."""

from .distributions import Choices as Choices
from .distributions import Distribution as Distribution
from .distributions import Integers as Integers
from .distributions import LogUniform as LogUniform
from .distributions import Normal as Normal
from .distributions import Uniform as Uniform
from .results import Sweep as Sweep
from .sensitivity import Sensitivity as Sensitivity
from .sensitivity import sensitivity as sensitivity
from .sweeping import sweep as sweep
