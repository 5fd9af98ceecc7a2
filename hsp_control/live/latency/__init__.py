"""Latency: how late the effort of a loop against the clock is, and what helps."""

from .control_loop import ControlLoop as ControlLoop
from .measuring import measure as measure
from .measuring import rehearse as rehearse
from .quiet import no_garbage_collection as no_garbage_collection
from .quiet import real_time_priority as real_time_priority
from .report import Latency as Latency
from .report import Quantiles as Quantiles
