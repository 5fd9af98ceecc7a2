"""Joint-space metrics W(q)."""

from hsp_control.law import MetricSample as MetricSample

from .fixed import ConstantMetric as ConstantMetric
from .fixed import CoordinatesMetric as CoordinatesMetric
from .fixed import FixedMetric as FixedMetric
from .fixed import IdentityMetric as IdentityMetric
from .mass_matrix import MassMatrixMetric as MassMatrixMetric
from .metric import Metric as Metric
