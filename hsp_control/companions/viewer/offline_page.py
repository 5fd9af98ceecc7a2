"""A page that needs no server: the live page with its files and content inlined."""

import base64
import gzip
import json
import re
from html import escape
from pathlib import Path
from typing import Any

from hsp_control.companions.viewer.commands import (
    CAPTION,
    PLOTS,
    LatestCommands,
    key_of,
    pack,
    unpack,
)
from hsp_control.companions.viewer.packing import ArrayTable, reduce_scene
from hsp_control.companions.viewer.transport import meshcat_page

_FILES = Path(__file__).parent / "page"
_NOTE = (
    "Written by hsp_control. Holds Meshcat's page, which holds three.js, and uPlot "
    "(all MIT)."
)
# The browser blocks all network access of the page, whatever the scripts do.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)


def scene_page(
    scene: LatestCommands, title: str, arrays: ArrayTable, **more: Any
) -> str:
    """Return a page that shows a scene and the plots beside it; see `offline.js`."""
    commands = [unpack(packed) for path, _, packed in scene.items() if path != PLOTS]
    reduced = reduce_scene(commands, arrays)
    content = {"type": "show", "commands": reduced, **more, "arrays": arrays.entries}
    live = (_FILES / "index.html").read_text(encoding="utf-8")
    body = live[live.index("<body>") + len("<body>") : live.index("</body>")]
    names = re.findall(r'<script src="([^"]+)"></script>', body)
    body = re.sub(r"<(script|template).*?</\1>\s*", "", body, flags=re.DOTALL)
    styles = [
        *map(_text, re.findall(r'<link rel="stylesheet" href="([^"]+)">', live)),
        *re.findall(r"<style>(.*?)</style>", live, flags=re.DOTALL),
        _text("offline.css"),
    ]
    licence = _text("uPlot.LICENSE.txt")
    scripts = [f"/* uPlot:\n{licence}*/", *map(_text, names), _text("offline.js")]
    return "\n".join(
        [
            "<!DOCTYPE html>",
            f"<!-- {_NOTE} -->",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title>",
            '<link rel="icon" href="data:,">',
            *(f"<style>{style}</style>" for style in styles),
            "</head>",
            f"<body>{body.rstrip()}",
            _block("scripts", json.dumps(scripts).encode()),
            _block("content", pack(content)),
            f"<script>{_text('offline_start.js')}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _text(name: str) -> str:
    """Return a file of the page, or of Meshcat's."""
    own = _FILES / name
    file = own if own.is_file() else meshcat_page() / name
    return file.read_text(encoding="utf-8")


def _block(name: str, data: bytes) -> str:
    # No time stamp in the archive: the same run gives the same file.
    packed = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    return f'<script type="application/octet-stream" id="{name}">{packed}</script>'


HEIGHT = 520  # height of a view in a notebook [pixels]


class InlineView:
    """A scene as the value of a notebook's cell: it needs no server and no kernel.

    The notebook holds all of it, so that it also works on another computer, as with
    JupyterHub, and in the notebook's HTML.

    Attributes:
        page: The page, a complete HTML document.
        height: The height of its frame [pixels].
    """

    def __init__(
        self, scene: LatestCommands, *, height: int = HEIGHT, url: str | None = None
    ) -> None:
        """Assemble the page.

        Args:
            scene: The commands that build the scene.
            height: The height of its frame [pixels].
            url: The address of the live scene, for the line below the frame.

        Raises:
            ExportError: If a mesh cannot be read, or the library for it is not
                installed.
        """
        self.height = height
        self._url = url
        caption = scene.get(key_of(CAPTION, "caption"))
        title = str(unpack(caption)["title"]) if caption else "hsp_control"
        self.page = scene_page(scene, title, ArrayTable(), plots=None)

    @property
    def size(self) -> int:
        """Its size in the notebook [bytes]."""
        return len(self._frame().encode())

    def __repr__(self) -> str:
        return f"InlineView({self.size / 1e6:.1f} MB)"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: the page itself in a frame."""
        live = (
            f'; live at <a href="{escape(self._url)}" target="_blank">'
            f"{escape(self._url)}</a> while the program runs"
            if self._url
            else ""
        )
        return (
            f"{self._frame()}"
            '<div style="font: 12px system-ui, sans-serif; opacity: 0.65">'
            f"{self.size / 1e6:.1f} MB in this notebook, without a server{live}</div>"
        )

    def _frame(self) -> str:
        # In its sandbox, the page cannot reach the notebook around it.
        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts" '
            f'allowfullscreen style="width: 100%; height: {self.height}px; border: 0; '
            'border-radius: 8px"></iframe>'
        )
