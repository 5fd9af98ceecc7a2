"""A view that is part of a notebook: the exported page inside a cell's output."""

from html import escape

from hsp_control.visualization.viewer.commands import CAPTION, PLOTS, unpack
from hsp_control.visualization.viewer.latest_commands import LatestCommands, key_of
from hsp_control.visualization.viewer.offline.page import assemble
from hsp_control.visualization.viewer.offline.scene_reduction import reduce_scene
from hsp_control.visualization.viewer.packed.packing import ArrayTable

HEIGHT = 520
"""Height of a view in a notebook [pixels]."""


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
            url: Where the same scene is live, for the line below the frame.

        Raises:
            ExportError: If a mesh cannot be read, or the library for it is not
                installed.
        """
        self.height = height
        self._url = url
        arrays = ArrayTable()
        commands = [
            unpack(packed) for path, _, packed in scene.items() if path != PLOTS
        ]
        caption = scene.get(key_of(CAPTION, "caption"))
        title = str(unpack(caption)["title"]) if caption else "hsp_control"
        content = {
            "type": "show",
            "commands": reduce_scene(commands, arrays),
            "plots": None,
            "about": None,
        }
        self.page = assemble(title, {**content, "arrays": arrays.entries})

    @property
    def size(self) -> int:
        """What it adds to the notebook [bytes]."""
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
