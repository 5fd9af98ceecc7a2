"""Unusual errors in a loop, a server or a log."""


class OddError(BaseException):
    """An exception that only a bare ``except`` or one of `BaseException` catches.

    Rust extensions raise such exceptions.
    """


class NamelessError(Exception):
    """An exception that cannot be printed."""

    def __str__(self) -> str:
        raise RuntimeError("it has no text")
