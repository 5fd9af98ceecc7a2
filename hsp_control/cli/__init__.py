"""The command line: ``hsp``."""

from . import startup as startup  # isort: skip: before the slow imports

from .main import main as main
