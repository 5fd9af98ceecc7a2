"""Messages as tables of tests write them: the place, the value, what would be right."""

import re


def wording(message: str) -> str:
    """Return the pattern of a message of which '...' leaves out words.

    ``"tasks.hand.frame: no ... 'pan' ... 'pen'"`` is a message that begins so and
    names the two in this order; what joins them can change without a test. One that
    begins with '...' need not be the message's beginning. An end is never required.
    """
    beginning = "" if message.startswith("...") else "^"
    pieces = message.removeprefix("...").split(" ... ")
    words = ".*".join(re.escape(piece.strip()) for piece in pieces)
    return f"(?s:{beginning}{words})"
