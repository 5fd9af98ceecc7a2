"""Watch a robot in a browser: live, or a run again."""

from .recorder import Recorder as Recorder
from .replay import robot_of as robot_of
from .replay import view_rollout as view_rollout
from .viewer import Viewer as Viewer
