"""A recorder's clip as a page would play it, for tests."""

from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.companions.viewer import SceneRecorder
from hsp_control.companions.viewer.commands import CLIP, Json, key_of, unpack


class Recorder(SceneRecorder):
    """A recorder that returns its content."""

    def paths(self, below: str = "") -> list[str]:
        """Return the paths of all objects that begin with ``below``."""
        return [
            path
            for path, name, _ in self.scene.items()
            if name == "object" and path.startswith(below)
        ]

    def command(self, path: str, name: str) -> Json | None:
        """Return the command that set the property ``name`` of a node, or None."""
        packed = self.scene.get(key_of(path, name))
        return None if packed is None else unpack(packed)

    def transform(self, path: str) -> np.ndarray:
        """Return the pose of a node in the world, shape (4, 4)."""
        total: np.ndarray = np.eye(4)
        nodes = path.split("/")
        for depth in range(2, len(nodes) + 1):
            command = self.command("/".join(nodes[:depth]), "transform")
            if command is not None:
                matrix: Any = command["matrix"]
                total = total @ np.reshape(matrix, (4, 4)).T
        return total


def reported(recorder: Recorder, path: str, kind: str) -> dict[str, Any]:
    """Return the last command of a kind at a path; there is one."""
    command = recorder.command(path, kind)
    assert command is not None
    return command


class Clip:
    """The clip of a recorder: the motion of its nodes."""

    def __init__(self, recorder: Recorder) -> None:
        begin = recorder.command(CLIP, "begin")
        assert begin is not None
        self.start, self.end = begin["start"], begin["end"]
        self._tracks: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}
        for track in begin["tracks"]:
            times = begin["clocks"][track["clock"]]
            values = np.reshape(track["values"], (len(times), -1)).astype(float)
            self._tracks[track["path"], track["property"]] = times, values

    def paths(self, below: str) -> set[str]:
        """Return the moving nodes below a path."""
        return {path for path, _ in self._tracks if path.startswith(below)}

    def times(self, path: str, name: str) -> np.ndarray:
        """Return a track's times."""
        return self._tracks[path, name][0]

    def values(self, path: str, name: str) -> np.ndarray:
        """Return a track's rows."""
        return self._tracks[path, name][1]

    def value(self, path: str, name: str, time: float) -> np.ndarray:
        """Return a track's value at a time, as the page's player would."""
        times, values = self._tracks[path, name]
        row = int(np.clip(np.searchsorted(times, time, "right") - 1, 0, len(times) - 1))
        after = min(row + 1, len(times) - 1)
        gap = times[after] - times[row]
        fraction = float(np.clip((time - times[row]) / gap, 0, 1)) if gap else 0.0
        here, there = values[row], values[after]
        if name == "quaternion":
            start, end = (pin.Quaternion(*x[[3, 0, 1, 2]]) for x in (here, there))
            return np.array(start.slerp(fraction, end).coeffs())
        if name == "visible":
            return there if fraction >= 1.0 else here
        return np.asarray(here + fraction * (there - here))

    def pose(self, path: str, time: float) -> Any:
        """Return a node's pose in its parent, shape (4, 4)."""
        turn = pin.Quaternion(self.value(path, "quaternion", time)).normalized()
        place = self.value(path, "position", time)
        return pin.SE3(turn.matrix(), place).homogeneous
