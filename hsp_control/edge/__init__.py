"""The edge: what is done where tasks cannot be met, so that nothing shakes there."""

from .resolution import Resolution as Resolution
