"""Configurations: from a YAML text to a ready experiment."""

from hsp_control.common.entry_points import own_names
from hsp_control.declaration.imported import import_file as import_file

from .experiment import Experiment as Experiment
from .experiment import load_experiment as load_experiment
from .recorder import Recorder as Recorder
from .scenario import Scenario as Scenario
from .scenario import ShownItems as ShownItems
from .scenario import ViewSettings as ViewSettings
from .scenario import json_schema as json_schema

__dir__ = own_names(__name__)
