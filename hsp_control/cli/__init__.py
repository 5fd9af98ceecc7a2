"""The command line: ``hsp``."""

from . import startup as startup  # isort: skip: before what takes a second

from .main import main as main
