"""The edge: bounds where tasks cannot be met, so that no arm oscillates."""

from .resolution import Resolution as Resolution
