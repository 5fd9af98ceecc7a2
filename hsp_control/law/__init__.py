"""Resolutions: from tasks and a field to an acceleration."""

from .problem import Problem as Problem
from .resolution import DAMPED as DAMPED
from .resolution import NOT_FINITE as NOT_FINITE
from .resolution import Resolution as Resolution
from .resolution import Resolved as Resolved
