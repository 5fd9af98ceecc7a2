"""Streams as references in a run: of points, orientations and poses."""

from copy import deepcopy
from typing import Any, Self

from hsp_control.declaration.nested import Remembering
from hsp_control.engine.plans import PartCalls
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.pose import PoseSample, PoseTrajectory
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class FollowedStream(Remembering):
    """A stream in a run, as a placed task follows it: it reads the run's plan."""

    run: StreamRun
    """Its messages, and its reference [-]."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return one with a copy of the run, which continues independently."""
        return type(self)(deepcopy(self.run, memo))

    def calls(self, out: Any) -> PartCalls:
        """Return the calls that write a sample; see `Trajectory.calls`."""
        if self.run.alone is not None:
            return self.run.alone.calls(out)
        self.run.prepare()
        calls: PartCalls = super().calls(out)  # type: ignore[misc]
        return calls


class FollowedPoint(FollowedStream, Trajectory):
    """x(t) of a stream in a run."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.run.chart.linear

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t); see `Trajectory.sample`."""
        out = self._output(out)
        state = self.run.at(t)
        out.position[:], out.velocity[:] = state.x, state.rate
        out.acceleration[:] = state.acceleration
        return out


class FollowedOrientation(FollowedStream, OrientationTrajectory):
    """R(t) of a stream in a run."""

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t); see `OrientationTrajectory.sample`."""
        out = self._output(out)
        self.run.chart.write_orientation(self.run.at(t), out)
        return out


class FollowedPose(FollowedStream, PoseTrajectory):
    """M(t) of a stream in a run."""

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if out is None:
            out = PoseSample.allocate()
        state, position = self.run.at(t), out.position
        position.position[:], position.velocity[:] = state.x[:3], state.rate[:3]
        position.acceleration[:] = state.acceleration[:3]
        self.run.chart.write_orientation(state, out.orientation)
        return out
