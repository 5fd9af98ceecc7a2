"""The workspace boundary: bounds where tasks cannot be met, against oscillation."""

from .bound_law import BoundLaw as BoundLaw
