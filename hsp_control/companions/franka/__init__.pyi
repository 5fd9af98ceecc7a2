from .connection import connect as connect
from .hardware import FrankaHardware as FrankaHardware
from .settings import FrankaSettings as FrankaSettings
from .settings import Load as Load
