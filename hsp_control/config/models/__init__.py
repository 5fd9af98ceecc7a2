"""The schema, one file for each part of a configuration."""
