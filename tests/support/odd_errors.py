"""Errors that a loop, a server or a log meets, and that no handler expects."""


class OddError(BaseException):
    """An exception that only a bare ``except`` or one of `BaseException` catches.

    Extensions in Rust raise such ones.
    """


class NamelessError(Exception):
    """One that cannot be printed."""

    def __str__(self) -> str:
        raise RuntimeError("it has no text")
