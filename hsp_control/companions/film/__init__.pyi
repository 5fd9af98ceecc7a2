from .film import FilmStyle as FilmStyle
from .film import export_film as export_film
