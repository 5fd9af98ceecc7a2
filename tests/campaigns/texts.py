"""Mutations of bytes and lines of any file."""

from collections.abc import Callable
from random import Random

JUNK = ["\0", "\t", "\ufeff", "\u2028", "\u202e", "\x7f", "\x85", "é", "漢",
    "\U0001f916",
        "\ufffe", "'", '"', "{", "}", "[", "]", ":", "&a", "*a", "!x", "|", ">", "%",
        "<", "&lt;", "]]>", "<!--", "\\", "\r", "-", "#", ",", "0", "e", ".",
        "nan"]  # fmt: skip


def flipped(data: bytes, random: Random) -> bytes:
    """Change some bytes."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 8, 64))):
        if changed:
            changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def cut(data: bytes, random: Random) -> bytes:
    """Remove the end, the beginning or a piece."""
    a, b = sorted(random.randrange(len(data) + 1) for _ in range(2))
    return random.choice((data[:a], data[b:], data[:a] + data[b:]))


def repeated(data: bytes, random: Random) -> bytes:
    """Repeat a piece once, or many times."""
    a = random.randrange(len(data) + 1)
    b = min(len(data), a + random.choice((1, 10, 100)))
    return data[:b] + data[a:b] * random.choice((1, 2, 1000)) + data[b:]


def junked(data: bytes, random: Random) -> bytes:
    """Insert characters with or without a meaning."""
    changed = data
    for _ in range(random.choice((1, 1, 2, 5))):
        a = random.randrange(len(changed) + 1)
        piece = random.choice(JUNK).encode() * random.choice((1, 1, 1, 50))
        changed = changed[:a] + piece + changed[a:]
    return changed


def lines_moved(data: bytes, random: Random) -> bytes:
    """Remove, repeat, exchange or indent lines."""
    lines = data.split(b"\n")
    for _ in range(random.choice((1, 1, 2, 4))):
        i, j = (random.randrange(len(lines)) for _ in range(2))
        match random.randrange(5):
            case 0:
                lines[i], lines[j] = lines[j], lines[i]
            case 1:
                lines.insert(j, lines[i])
            case 2 if len(lines) > 1:
                del lines[i]
            case 3:
                lines[i] = random.choice((b" ", b"\t", b"    ")) + lines[i]
            case _:
                lines[i] = lines[i].lstrip()
    return b"\n".join(lines)


def recoded(data: bytes, random: Random) -> bytes:
    """Write the text in another encoding."""
    text = data.decode("utf-8", "replace")
    codec = random.choice(
        ("utf-16", "utf-32", "latin-1", "utf-8-sig", "cp037", "utf-7")
    )
    return text.encode(codec, "replace")


TRICKS: list[Callable[[bytes, Random], bytes]] = [
    flipped, cut, repeated, junked, lines_moved, recoded,
]  # fmt: skip
"""All mutations."""
