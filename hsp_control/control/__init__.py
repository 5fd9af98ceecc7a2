"""From tasks, a field and constraints to an effort."""

from .controller import Controller as Controller
from .output import ControlOutput as ControlOutput
from .output import Diagnostics as Diagnostics
