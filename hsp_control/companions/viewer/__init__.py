"""Show a robot in a browser: during a run, or from a log."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .comparison import ComparedRun as ComparedRun
    from .export_page import export_html as export_html
    from .live import LiveView as LiveView
    from .offline_page import InlineView as InlineView
    from .replay import robot_of as robot_of
    from .replay import show as show
    from .replay import view_logs as view_logs
    from .transport import SceneRecorder as SceneRecorder
    from .viewer import Viewer as Viewer
    from .watching import Watch as Watch
    from .watching import watch as watch

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "comparison": "ComparedRun",
        "export_page": "export_html",
        "live": "LiveView",
        "offline_page": "InlineView",
        "replay": "robot_of show view_logs",
        "transport": "SceneRecorder",
        "viewer": "Viewer",
        "watching": "Watch watch",
    },
)
