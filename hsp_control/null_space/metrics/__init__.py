"""Joint-space metrics W(q)."""

from hsp_control.common.entry_points import own_names
from hsp_control.law import MetricSample as MetricSample

from .metric import ConstantMetric as ConstantMetric
from .metric import CoordinatesMetric as CoordinatesMetric
from .metric import FixedMetric as FixedMetric
from .metric import IdentityMetric as IdentityMetric
from .metric import MassMatrixMetric as MassMatrixMetric
from .metric import Metric as Metric

__dir__ = own_names(__name__)
