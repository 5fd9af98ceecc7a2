"""Visualization: figures of a log, and a robot in the browser."""
