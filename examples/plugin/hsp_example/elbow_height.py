"""A field: a frame, such as the elbow, keeps a height."""

from hsp_control.declaration import within
from hsp_control.declaration.quantities import Number
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import Cost
from hsp_control.robot import RobotState


class ElbowHeight(Cost, type="elbow_height"):
    """f = (z - height)², with gradient and rate by differences."""

    frame: str
    """Name of the frame [-]."""
    height: Number = 0.6
    """The height [m]."""

    def placed(self, start: Start) -> "ElbowHeight":
        """Return the cost, whose frame exists."""
        with within("frame"):
            start.state.robot.frame_id(self.frame)
        return self

    def value(self, state: RobotState) -> float:
        """Return f."""
        return float((state.position(self.frame)[2] - self.height) ** 2)
