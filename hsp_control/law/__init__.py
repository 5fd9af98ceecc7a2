"""The law: from tasks and a field to an acceleration, equations (7) and (13)."""

from .outcome import Outcome as Outcome
from .problem import Problem as Problem
from .resolution import Resolution as Resolution
from .resolution import Resolved as Resolved
from .resolution import singular_values as singular_values
