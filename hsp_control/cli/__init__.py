"""The command line: ``hsp``."""

from .main import main as main
