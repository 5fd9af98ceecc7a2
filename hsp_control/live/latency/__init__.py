"""Measure and reduce the latency of a real-time control loop."""

from .control_loop import ControlLoop as ControlLoop
from .measure_latency import dry_run as dry_run
from .measure_latency import measure as measure
from .real_time import no_garbage_collection as no_garbage_collection
from .real_time import real_time_priority as real_time_priority
from .report import Latency as Latency
from .report import Quantiles as Quantiles
