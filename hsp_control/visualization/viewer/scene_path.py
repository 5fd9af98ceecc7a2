"""Paths in the scene tree."""


def path_element(name: str) -> str:
    """Return a name as one element of a path in the scene tree: without slashes."""
    return name.replace("/", "_") or "_"
