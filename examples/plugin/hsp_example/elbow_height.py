"""A field: a frame, such as the elbow, keeps a height."""

from hsp_control.declaration.quantities import Number
from hsp_control.engine.plans import KernelCall, kernel
from hsp_control.null_space.fields import Cost


class ElbowHeight(Cost, type="elbow_height"):
    """f = (z - height)², with gradient and rate by a kernel."""

    frame: str
    """Name of the frame [-]."""
    height: Number = 0.6
    """The height [m]."""

    def kernel(self, state) -> KernelCall:
        """Return the kernel; see `Cost.kernel`."""
        return _elbow_height, (state.frame(self.frame), self.height)


@kernel
def _elbow_height(frame, height, gradient, rate):
    """Write ∇f = 2 (z - height) J_z and its rate, and return f."""
    away = frame.position[2] - height
    for i in range(gradient.shape[0]):
        J, J_dot = frame.jacobian[2, i], frame.jacobian_dot[2, i]
        gradient[i] = 2.0 * away * J
        rate[i] = 2.0 * (frame.velocity[2] * J + away * J_dot)
    return away * away
