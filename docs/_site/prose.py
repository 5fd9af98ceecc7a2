"""Plain text of docstrings as Markdown: stars, bars and brackets are literal."""


def paragraphs(text: str) -> str:
    """Return paragraphs, separated by empty lines."""
    return "\n\n".join(plain(each) for each in text.split("\n\n"))


def plain(text: str) -> str:
    """Return a paragraph on one line, as in a cell of a table."""
    parts = text.replace("``", "`").split("`")
    for k in range(0, len(parts), 2):
        for sign in "*_|<[":
            parts[k] = parts[k].replace(sign, "\\" + sign)
    return "`".join(parts).replace("\n", " ")
