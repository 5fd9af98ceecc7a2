from .findings import Finding as Finding
from .findings import Inspection as Inspection
from .findings import inspect as inspect
