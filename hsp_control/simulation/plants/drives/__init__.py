"""Drives: they turn the commanded effort into the applied one."""

from .drive import Drive as Drive
from .drive import Drives as Drives
from .drive import Driving as Driving
from .dropped_periods import DroppedPeriods as DroppedPeriods
from .effort_delay import EffortDelay as EffortDelay
from .effort_noise import EffortNoise as EffortNoise
from .jitter import Jitter as Jitter
from .saturation import Saturation as Saturation
