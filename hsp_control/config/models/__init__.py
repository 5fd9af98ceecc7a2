"""The schema, a file for each part of a configuration."""
