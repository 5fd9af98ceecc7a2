"""The law: from tasks and a field to an acceleration, equations (7) and (13)."""

from .diagnosis import singular_values as singular_values
from .outcome import Outcome as Outcome
from .problem import Problem as Problem
from .samples import CONSTANT as CONSTANT
from .samples import IDENTITY as IDENTITY
from .samples import VARYING as VARYING
from .samples import FieldSample as FieldSample
from .samples import MetricSample as MetricSample
from .samples import TaskSample as TaskSample
