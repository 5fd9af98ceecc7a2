"""From tasks, a field and constraints to an effort."""

from .controller import Controller as Controller
from .controller import ControlOutput as ControlOutput
from .controller import Diagnostics as Diagnostics
