"""Frozen controllers: a step, with its memory, for a program without Python.

`freeze` writes a file, and ``hsp_step.h`` runs it: the same calls, and the same bits.
"""

from hsp_control.frozen.freezing import freeze as freeze
from hsp_control.frozen.library import cmake_folder as cmake_folder
from hsp_control.frozen.library import compiler_flags as compiler_flags
from hsp_control.frozen.library import include_folder as include_folder
from hsp_control.frozen.library import library as library
