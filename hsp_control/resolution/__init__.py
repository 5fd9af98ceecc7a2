"""Resolutions: from tasks and a field to an acceleration."""

from .resolution import Resolution as Resolution
from .resolution import Resolved as Resolved
