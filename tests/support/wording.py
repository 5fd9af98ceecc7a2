"""Messages in tables of tests: the place, the value, the correct form."""

import re


def wording(message: str) -> str:
    """Return the pattern of a message in which '...' stands for any words.

    ``"tasks.hand.frame: no ... 'pan' ... 'pen'"`` matches a message that begins so and
    names the two in this order; the words between may change. One that begins with
    '...' matches anywhere. The end of a message is never required.
    """
    beginning = "" if message.startswith("...") else "^"
    pieces = message.removeprefix("...").split(" ... ")
    words = ".*".join(re.escape(piece.strip()) for piece in pieces)
    return f"(?s:{beginning}{words})"
