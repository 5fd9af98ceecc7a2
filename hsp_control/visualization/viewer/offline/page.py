"""Assembles the page: scene, plots and all scripts in one file."""

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable
from pathlib import Path

import umsgpack  # type: ignore[import-untyped]

from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.server import meshcat_page

_LIVE = Path(__file__).parents[1] / "page"
_OWN = Path(__file__).parent / "page"
_SCRIPTS = ("run_switch.js", "export.js")
_STYLES = ("export.css",)
_NOTE = (
    "Written by hsp_control. Holds Meshcat's page (MIT), which holds three.js (MIT)."
)
# The browser blocks all network access of the page, whatever the scripts do.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)


def assemble(title: str, content: Json) -> str:
    """Return the page's HTML: the live page with its files inlined, and its content."""
    live = (_LIVE / "index.html").read_text(encoding="utf-8")
    body = live[live.index("<body>") + len("<body>") : live.index("</body>")]
    names = re.findall(r'<script src="([^"]+)"></script>', body)
    body = re.sub(r"<script.*?</script>\s*", "", body, flags=re.DOTALL)
    styles = [
        *((_LIVE / name).read_text(encoding="utf-8") for name in _stylesheets(live)),
        *re.findall(r"<style>(.*?)</style>", live, flags=re.DOTALL),
        *((_OWN / name).read_text(encoding="utf-8") for name in _STYLES),
    ]
    scripts = [
        *(_live_script(name).read_text(encoding="utf-8") for name in names),
        *((_OWN / name).read_text(encoding="utf-8") for name in _SCRIPTS),
    ]
    return "\n".join(
        [
            "<!DOCTYPE html>",
            f"<!-- {_NOTE} -->",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{html.escape(title)}</title>",
            '<link rel="icon" href="data:,">',
            *(f"<style>{style}</style>" for style in styles),
            "</head>",
            f"<body>{body.rstrip()}",
            _block("scripts", json.dumps(scripts).encode()),
            _block("content", umsgpack.packb(content)),
            f"<script>{(_OWN / 'start.js').read_text(encoding='utf-8')}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _stylesheets(page: str) -> Iterable[str]:
    return re.findall(r'<link rel="stylesheet" href="([^"]+)">', page)


def _live_script(name: str) -> Path:
    own = _LIVE / name
    return own if own.is_file() else meshcat_page() / name


def _block(name: str, data: bytes) -> str:
    # No time stamp in the archive: the same run gives the same file.
    packed = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    return f'<script type="application/octet-stream" id="{name}">{packed}</script>'
