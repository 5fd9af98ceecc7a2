"""A run as a file that one can send: a page that plays offline, or a film."""

from .html import export_html as export_html
