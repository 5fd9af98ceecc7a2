"""Names as elements of a path in the scene tree."""


def element(name: str) -> str:
    """Return a name as one element of a path."""
    return name.replace("/", "_") or "_"
