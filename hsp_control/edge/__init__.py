"""The edge: bounds where tasks cannot be met, so that no arm oscillates."""

from .bound_law import BoundLaw as BoundLaw
