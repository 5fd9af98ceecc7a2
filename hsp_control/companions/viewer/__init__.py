"""Show a robot in a browser: during a run, or from a log."""

from hsp_control.common.entry_points import own_names
from hsp_control.config.view_settings import ShownItems as ShownItems
from hsp_control.config.view_settings import ViewSettings as ViewSettings

from .comparison import ComparedRun as ComparedRun
from .export_page import export_html as export_html
from .live import LiveView as LiveView
from .offline_page import InlineView as InlineView
from .replay import robot_of as robot_of
from .replay import show as show
from .replay import view_logs as view_logs
from .transport import SceneRecorder as SceneRecorder
from .viewer import Viewer as Viewer

__dir__ = own_names(__name__)
