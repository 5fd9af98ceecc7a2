"""The command line: ``hsp``."""

from . import interrupts as interrupts  # isort: skip: before the slow imports

from .main import main as main
