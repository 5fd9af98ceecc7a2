from . import changes as changes
from . import compensation as compensation
from . import estimation as estimation
from . import plans as plans
from .controller import Controller as Controller
from .output import ControlOutput as ControlOutput
from .output import Diagnostics as Diagnostics
