"""Films of a run: a headless browser draws the frames of the page."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .film import FilmStyle as FilmStyle
    from .film import export_film as export_film

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "film": "FilmStyle export_film",
    },
)
