"""Tables of the site's reference that are written from this companion's code."""

from .reflexes import table

PAGES = {
    "franka_errors": (
        "# Errors of a Franka arm\n\nThe names that the arm gives to an abort; "
        f"`hsp live` prints the same advice.\n\n{table()}\n"
    )
}
"""Their text in Markdown, by name."""
