"""A message: one target, a velocity, or a chunk of waypoints with times."""

import json
from collections.abc import Mapping
from math import inf
from typing import Any, Literal, NamedTuple, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import StreamError

MOST_WAYPOINTS = 1000  # maximum number of waypoints of one message
LARGEST = 1e6
"""Maximum magnitude of a number [m or rad]: larger ones are mistakes, and would
overflow."""
LATEST = 1e12  # maximum time [s]; a clock that starts in 1970 shows 2e9
NO_TOOL = "axes is 'tool'; a stream without an orientation has no tool"
_UNIT = 1e-3
"""Deviation of a quaternion's norm from 1 that may be a sender's rounding."""


Axes = Literal["world", "tool"]
"""The axes in which a velocity is commanded: the world's, or the moving body's."""


KINDS = (
    *("target", "velocity", "world velocity", "tool velocity"),
    *("chunk", "chunk goes on"),
)
"""Kinds of rows: a target, a velocity alone, in the stream's axes or in its own ones,
or a waypoint of a chunk, the first one or a later one."""


class Space(NamedTuple):
    """The kind of a stream's values: linear coordinates, then perhaps a quaternion."""

    # Number of linear coordinates; None: not known yet.
    linear: int | None
    rotational: bool  # whether a quaternion (x, y, z, w) follows them

    @property
    def width(self) -> int | None:
        """The number of components of a value."""
        return None if self.linear is None else self.linear + 4 * self.rotational

    @property
    def rates(self) -> int | None:
        """The number of components of a velocity; an angular velocity has three."""
        return None if self.linear is None else self.linear + 3 * self.rotational

    @property
    def words(self) -> str:
        """The components of a value in words, for messages."""
        if self == POSE:
            return "x, y, z and a quaternion (x, y, z, w)"
        if self.rotational:
            return "a quaternion (x, y, z, w)"
        return ""


POSE = Space(3, True)
ORIENTATION = Space(0, True)


class Message(NamedTuple):
    """Waypoints, or a velocity alone, as rows of the engine's queue.

    See ``engine/streams/message_queue.hpp``.
    """

    # (k, 3): `KINDS`, whether there are velocities, whether there is a time
    what: Indices
    # (k, 3): its time by the sender's clock, that of the waypoint after it, and that of
    # taking it by the controller's clock; -inf: at once [s]
    times: Array
    # The waypoints, (k, width), quaternions of norm 1; None: the message is a velocity
    # alone.
    values: Array | None
    # Their velocities, (k, rates), in world axes; None: unknown.
    velocities: Array | None
    size: int  # its number of numbers

    @classmethod
    def of(
        cls,
        t: float | None,
        values: Array | None,
        velocities: Array | None,
        *,
        times: Array | None = None,
        axes: Axes | None = None,
    ) -> Self:
        """Return a message; ``times``: of a chunk, after ``t`` [s]."""
        kind = "velocity" if axes is None else f"{axes} velocity"
        if values is not None:
            kind = "target" if times is None else "chunk"
        arrays = [each for each in (values, velocities) if each is not None]
        what = np.empty((len(arrays[0]), 3), dtype=np.int64)
        what[:] = KINDS.index(kind), velocities is not None, t is not None
        rows = np.empty((len(what), 3))
        rows[:] = 0.0 if t is None else t, 0.0, -inf
        if times is not None:
            what[1:, 0], rows[:, 1] = KINDS.index("chunk goes on"), times
        size = len(what) + sum(each.size for each in arrays)
        return cls(what, rows, values, velocities, size)

    @property
    def t(self) -> float | None:
        """Its time by the sender's clock [s]; None: unknown, now."""
        return float(self.times[0, 0]) if self.what[0, 2] else None

    @property
    def axes(self) -> Axes | None:
        """Axes of a velocity alone, if they were given."""
        kind = KINDS[self.what[0, 0]]
        return {"world velocity": "world", "tool velocity": "tool"}.get(kind)  # type: ignore[return-value]

    @property
    def at(self) -> float:
        """When it is taken, by the controller's clock; -inf: at once [s]."""
        return float(self.times[0, 2])

    def to_dict(self, t: float) -> dict[str, Any]:
        """Return its data for `message_of`, and the time ``at`` of taking it.

        Args:
            t: Time of the step that read it [s].
        """
        data: dict[str, Any] = {"at": t if self.at == -inf else self.at}
        if self.t is not None:
            data["t"] = self.t
        chunk = KINDS[self.what[0, 0]] == "chunk"
        for one, several in (("value", "values"), ("velocity", "velocities")):
            array = getattr(self, several)
            if array is not None and chunk:
                data[several] = array.tolist()
            elif array is not None:
                data[one] = array[0].tolist()
        if chunk:
            data["times"] = self.times[:, 1].tolist()
        if self.axes is not None:
            data["axes"] = self.axes
        return data


def message_of(data: Any, space: Space) -> Message:
    """Return the message that JSON data or the arguments of `send` declare."""
    if not isinstance(data, Mapping):
        raise StreamError(f"a message is {_shown(data)}; needs a mapping")
    if unknown := [key for key in data if key not in _KEYS]:
        raise StreamError(
            f"a message has the key {unknown[0]!r:.40}; known are {', '.join(_KEYS)}"
        )
    given = {key: value for key, value in data.items() if value is not None}
    _check_alternatives(given)
    t = None if "t" not in given else _clock(given["t"])
    values = _rows(given, "value", "values", space.width, space.words)
    rates = "linear and angular velocities" if space.rotational else ""
    velocities = _rows(given, "velocity", "velocities", space.rates, rates)
    if values is None:
        if velocities is None or len(velocities) != 1:
            raise StreamError("a message needs a value, values or one velocity")
        return Message.of(t, None, velocities, axes=_axes(given, space))
    if "axes" in given:
        raise StreamError("axes are only for a velocity without a value; remove axes")
    if velocities is not None and len(velocities) != len(values):
        raise StreamError(
            f"there are {len(velocities)} velocities for {len(values)} values"
        )
    if space.rotational:
        _normalise(values)
    return Message.of(t, values, velocities, times=_times(given, len(values)))


def parsed(text: str | bytes) -> Any:
    """Return the contents of a JSON text; NaN and Infinity are not JSON."""
    return json.loads(text, parse_constant=_refuse_constant)


_KEYS = ("value", "values", "times", "velocity", "velocities", "axes", "t")


def _check_alternatives(given: Mapping[str, Any]) -> None:
    for one, several in (("value", "values"), ("velocity", "velocities")):
        if one in given and several in given:
            raise StreamError(f"give either {one} or {several}")
    if "values" in given and "times" not in given:
        raise StreamError("values need times [s], one for each")
    if "times" in given and "values" not in given:
        raise StreamError("times need values, one for each")


def _axes(given: Mapping[str, Any], space: Space) -> Axes | None:
    """Return the axes of a velocity; None: those of its stream."""
    axes: Any = given.get("axes")
    if axes not in (None, "world", "tool"):
        raise StreamError(f"axes is {_shown(axes)}; needs 'world' or 'tool'")
    if axes == "tool" and space.linear is not None and not space.rotational:
        raise StreamError(NO_TOOL)
    return axes  # type: ignore[no-any-return]


def _clock(value: Any) -> float:
    """Return the time of a sender's clock [s]."""
    number = isinstance(value, int | float | np.floating | np.integer)
    if isinstance(value, bool) or not number or not abs(value) <= LATEST:
        raise StreamError(
            f"t, the time of the sender's clock, is {_shown(value)}; needs a number of "
            f"at most {LATEST:g} s"
        )
    return float(value)


def _rows(
    given: Mapping[str, Any], one: str, several: str, width: int | None, words: str
) -> Array | None:
    """Return one row or several, shape (k, width); None if there are none."""
    name = one if one in given else several
    if name not in given:
        return None
    rows = _numbers(given[name], name, 1 if name == one else 2)
    rows = rows[None, :] if name == one else rows
    if rows.shape[1] == 0:
        raise StreamError(f"{name} is empty")
    if not 1 <= len(rows) <= MOST_WAYPOINTS:
        raise StreamError(f"{name} has {len(rows)} rows; needs 1 to {MOST_WAYPOINTS}")
    if width is not None and rows.shape[1] != width:
        raise StreamError(
            f"{name} has {rows.shape[1]} numbers; this stream needs {width}"
            + (f": {words}" if words else "")
        )
    return rows


def _times(given: Mapping[str, Any], count: int) -> Array | None:
    """Return the times of the waypoints after ``t``, shape (count,), of a chunk."""
    if "times" not in given:
        return None
    times = _numbers(given["times"], "times", 1)
    if len(times) != count:
        raise StreamError(f"there are {len(times)} times for {count} values")
    if (np.diff(times) <= 0.0).any():
        k = int(np.flatnonzero(np.diff(times) <= 0.0)[0])
        raise StreamError(
            f"times must increase; times[{k + 1}] = {times[k + 1]:g} is not later than "
            f"times[{k}] = {times[k]:g}"
        )
    return times


def _normalise(values: Array) -> None:
    """Scale the quaternions to norm 1, in place."""
    norms = np.linalg.norm(values[:, -4:], axis=1)
    worst = int(np.abs(norms - 1.0).argmax())
    if abs(norms[worst] - 1.0) > _UNIT:
        raise StreamError(
            f"the quaternion {values[worst, -4:].tolist()} has norm "
            f"{norms[worst]:.6g}; needs 1"
        )
    off = np.abs(norms - 1.0) > 1e-15  # otherwise a recording would change by a bit
    values[off, -4:] /= norms[off, None]


def _numbers(value: Any, name: str, ndim: int) -> Array:
    """Return an array of finite numbers, copied."""
    needs = ("a number", "a list of numbers", "a list of lists of numbers")[ndim]
    try:
        array = _as_array(value)
    except (TypeError, ValueError, OverflowError):
        raise StreamError(f"{name} is {_shown(value)}; needs {needs}") from None
    if array.ndim != ndim:
        raise StreamError(f"{name} has shape {array.shape}; needs {needs}")
    if not (np.abs(array) <= LARGEST).all():  # also NaN
        bad = array[~(np.abs(array) <= LARGEST)].ravel()[0]
        raise StreamError(
            f"{name} contains {bad:g}; needs finite numbers of at most {LARGEST:g}"
        )
    return array


def _as_array(value: ArrayLike) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise TypeError
    return np.array(array, dtype=np.float64)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _refuse_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")
