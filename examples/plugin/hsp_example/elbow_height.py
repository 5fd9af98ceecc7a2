"""A field: a frame, such as the elbow, keeps a height."""

from pathlib import Path

from hsp_control.declaration.quantities import Number
from hsp_control.engine.own_kinds import load
from hsp_control.engine.plans import PartCall
from hsp_control.null_space.fields import Cost


class ElbowHeight(Cost, type="elbow_height"):
    """f = (z - height)², with gradient and rate in C++: ``elbow_height.cpp``."""

    frame: str
    """Name of the frame [-]."""
    height: Number = 0.6
    """The height [m]."""

    def call(self, state) -> PartCall:
        """Return the kind of call with its arguments; see `Cost.call`."""
        kind = load(Path(__file__).with_name("elbow_height.cpp")).ElbowHeight
        return PartCall(kind, frame=state.frame(self.frame), height=self.height)
