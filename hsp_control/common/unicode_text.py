"""Text in UTF-8, also if it contains the name of a file that is not.

Python reads the bytes of such a name as lone surrogates, which no encoding accepts.
They are written as escapes, a backslash with ``udce9``: in JSON that is the same
character.
"""

import json
from typing import Any


def utf8(text: str) -> bytes:
    """Return a text in UTF-8, with lone surrogates as escapes."""
    return text.encode(errors="backslashreplace")


def encodable(text: str) -> str:
    """Return a text with lone surrogates as escapes, for a library that encodes it."""
    return utf8(text).decode()


def json_text(data: Any) -> str:
    """Return data as JSON that can be encoded; reading it returns the same texts."""
    return encodable(json.dumps(data, ensure_ascii=False))
