"""Replays in the pages: a bundled run, exported, in a frame."""

from pathlib import Path
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective
from sphinx.util.osutil import relative_uri

from hsp_control.common.resources import bundled_configs

_FRAME = (
    '<figure class="replay"><iframe src="{address}" loading="lazy" title="{title}" '
    'allow="fullscreen"></iframe><figcaption>{title}. '
    '<a href="{address}" target="_blank">Alone in a tab.</a></figcaption></figure>'
)


class Replay(SphinxDirective):
    """A frame with the replay of a bundled configuration: ``{replay} paper/2_rest``."""

    required_arguments = 1
    option_spec: ClassVar = {
        "title": directives.unchanged_required,
        "moment": directives.unchanged,  # a time [s], and the event then
    }

    def run(self) -> list[nodes.Node]:
        """Return the frame; `tools/replays.py` has written its page."""
        if self.arguments[0] not in bundled_configs():  # of a companion taken away
            return []
        name = self.arguments[0].replace("/", "-") + ".html"
        page = Path(self.env.srcdir) / "_static" / "replays" / name
        if not page.is_file():
            raise ExtensionError(f"there is no {page}; `make docs` writes it")
        here = self.env.app.builder.get_target_uri(self.env.docname)
        address = relative_uri(here, f"_static/replays/{name}")
        title, moment = self.options["title"], self.options.get("moment", "")
        frame = _FRAME.format(address=address, title=title)
        if moment:
            t, what = moment.split(maxsplit=1)
            link = f' <a href="{address}#t={t}" target="_blank">{what}</a></figcaption>'
            frame = frame.replace("</figcaption>", link)
        return [nodes.raw("", frame, format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("replay", Replay)
    return {"parallel_read_safe": True}
