"""Watch a robot in a browser: live, or a run again."""

from .comparison import Act as Act
from .live import LiveView as LiveView
from .recorder import Recorder as Recorder
from .replay import robot_of as robot_of
from .replay import view_logs as view_logs
from .viewer import Viewer as Viewer
