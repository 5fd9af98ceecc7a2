"""Exports a run: to a page that plays offline, into a notebook, or to a film."""

from .film import FilmStyle as FilmStyle
from .film import export_film as export_film
from .html import export_html as export_html
from .inline import InlineView as InlineView
from .inline import show as show
