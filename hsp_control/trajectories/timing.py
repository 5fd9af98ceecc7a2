"""The smooth step from 0 to 1, at rest at both ends."""

from hsp_control.common.kernels import kernel


@kernel
def smooth_step(
    t: float, start_time: float, duration: float
) -> tuple[float, float, float]:
    """Return s(t) = 10 u³ - 15 u⁴ + 6 u⁵, u = (t - t0) / T, with s' and s''.

    s goes from 0 to 1 with zero velocity and acceleration at both ends; of all such
    motions it has the minimum jerk. It is exactly 0 before and exactly 1 after, hence
    C². The peaks of s' and s'' are 1.875 / T and 5.77 / T².
    """
    u = (t - start_time) / duration
    if u <= 0.0:
        return 0.0, 0.0, 0.0
    if u >= 1.0:
        return 1.0, 0.0, 0.0
    rest = 1.0 - u
    s = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    s_dot = 30.0 * u * u * rest * rest / duration
    s_ddot = 60.0 * u * rest * (rest - u) / (duration * duration)
    return s, s_dot, s_ddot
