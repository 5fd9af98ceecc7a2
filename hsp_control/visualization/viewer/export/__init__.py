"""Exports a run: to a page that plays offline, or to a film."""

from .film import FilmStyle as FilmStyle
from .film import export_film as export_film
from .html import export_html as export_html
