"""Configurations: from a YAML text to a checked scenario, with errors that help."""
