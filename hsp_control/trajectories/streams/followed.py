"""Streams as references in a run: of points, orientations and poses."""

from copy import deepcopy
from typing import Any, Self

from hsp_control.declaration.nested import Remembering
from hsp_control.engine.plans import TIME, PartCall, PartCalls, planned
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
        run = self.run
        if run.alone is not None:
            return run.alone.calls(out)
        return [PartCall(run.bring, t=TIME), *run.chart.calls(run.state, out)]

    def _write(self, t: float, out: Any) -> None:
        """Write a sample at a time [s]."""
        self.run.bring(t)
        planned(self.run.chart.calls(self.run.state, out)).run(t)


class FollowedPoint(FollowedStream, Trajectory):
    """x(t) of a stream in a run."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.run.chart.linear

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t); see `Trajectory.sample`."""
        out = self._output(out)
        self._write(t, out)
        return out


class FollowedOrientation(FollowedStream, OrientationTrajectory):
    """R(t) of a stream in a run."""

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t); see `OrientationTrajectory.sample`."""
        out = self._output(out)
        self._write(t, out)
        return out


class FollowedPose(FollowedStream, PoseTrajectory):
    """M(t) of a stream in a run."""

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        out = self._output(out)
        self._write(t, out)
        return out
