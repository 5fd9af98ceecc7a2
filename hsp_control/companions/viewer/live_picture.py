"""The page of a running loop: the scene, its handles and its knobs."""

import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.log_series import joint_names
from hsp_control.companions.viewer.clearances import capsules, distances, influence
from hsp_control.companions.viewer.clip import track_fields
from hsp_control.companions.viewer.commands import (
    PLAY,
    PageCommand,
    delete,
    page_command,
    typed_array,
)
from hsp_control.companions.viewer.comparison import GHOST_OPACITY, ghost_color
from hsp_control.companions.viewer.ghosts import Ghosts
from hsp_control.companions.viewer.live_plots import live_plots
from hsp_control.companions.viewer.motion import Layer, RunMotion
from hsp_control.companions.viewer.obstacles import logged_shapes
from hsp_control.companions.viewer.run_drawing import RunDrawing, all_layers, line_color
from hsp_control.companions.viewer.self_motion_preview import PreviewDrawing
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.control.interface import Controller
from hsp_control.null_space.fields import FieldSum, NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import sample_weight
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import PULLED, REACHED, unreached

FRAME = 1.0 / 30.0  # time between two pictures [s]
_FIELD_LAYERS = ("influence", "distances", "capsules")
_BATCHES = 64
"""Maximum number of batches of samples that wait for a page; older ones are dropped."""


class Touched(Protocol):
    """The handles and knobs that a user can move on the page, with their labels."""

    targets: dict[str, Any]
    obstacles: dict[str, Any]
    knobs: dict[str, Any]
    message: str
    warning: bool

    @property
    def settings(self) -> Mapping[str, float | bool]:
        """The values of the knobs."""

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return where the targets and the obstacles are, by name."""


class Rows(Protocol):
    """Rows of a log, some of them or all."""

    @property
    def count(self) -> int:
        """The number of rows so far."""

    def rows(self, start: int) -> dict[str, Array]:
        """Return the columns from a row on."""


class OtherLaw(Protocol):
    """The same robot with another law."""

    law: str

    @property
    def q(self) -> Array:
        """Its configuration, shape (nq,)."""


class Shown(Protocol):
    """A running loop that is shown: `hsp play`, a live loop, or a user's own loop."""

    over: str

    previews: bool  # whether a preview of self-motion is shown

    @property
    def laws(self) -> Sequence[str]:
        """The laws with which it can be compared."""

    @property
    def other(self) -> OtherLaw | None:
        """The law with which it is compared, if any."""

    @property
    def kind(self) -> str:
        """``simulated``, ``live``, ``held`` (by a dead-man's key) or ``watched``."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    @property
    def title(self) -> str:
        """The title of the scene."""

    @property
    def controller(self) -> Controller | None:
        """The controller; None: only the log's columns are available."""

    @property
    def recorder(self) -> Rows:
        """The log."""

    @property
    def meta(self) -> dict[str, Any]:
        """The meta data of the log so far."""

    @property
    def handles(self) -> Touched:
        """The handles and knobs."""

    @property
    def pushes(self) -> object:
        """The springs by which links can be pulled; None: they cannot."""

    @property
    def t(self) -> float:
        """The time of the present row [s]."""

    def pull(self) -> tuple[Array, Array, float] | None:
        """Return the pulled point and the hand, both (3,) [m], and the force [N]."""


class Picture:
    """Draws a play on the pages of a viewer."""

    def __init__(self, session: Shown, viewer: Viewer) -> None:
        """Draw the present instant, with all handles."""
        self._session, self._viewer = session, viewer
        self._batch = 0
        color, opacity = ghost_color(1), GHOST_OPACITY
        self._preview = PreviewDrawing(session.robot)
        self._ghost = Ghosts("other law", session.robot, color, opacity)
        self.begin()

    def begin(self) -> None:
        """Draw the scene anew after a reset of the session."""
        session, viewer = self._session, self._viewer
        self._sent = 0
        self._compared = False
        self._preview.begin()
        self._moved: dict[str, float] = {}
        self._away: dict[str, str] = {}
        self._meta = session.meta
        self._field, self._acting = self._present_field(), self._acting_terms()
        motion = self._motion()
        self._shown = viewer.view.show.all_fields()
        self._run = RunDrawing(
            viewer.drawing, motion, self._layers(motion), shown=self._shown
        )
        title = session.title
        self._size = viewer.set_stage(self._run, title)
        self._plots = live_plots(session.recorder.rows(0), self._meta)
        viewer.transport.send([self._setup(title), *self.frame(running=True, rate=1.0)])

    def _layers(self, motion: RunMotion) -> dict[str, Layer]:
        """Return the layers of the present instant, those of the present field too."""
        robot, controller = self._session.robot, self._session.controller
        dark = self._viewer.dark
        layers = all_layers(robot, motion, None, dark=dark)
        del layers["paths"]
        drawn = {name for name, task in self._meta["tasks"].items() if task["drawn"]}
        if set(self._session.handles.targets) >= drawn:
            del layers["targets"]  # the handles replace them
        if controller is None:
            return layers
        shown, ink = logged_shapes(motion.rows), line_color(dark=dark)
        acting = FieldSum(self._acting) if self._acting else Rest()
        layers["influence"] = influence(acting, shown, "/influence")
        layers["distances"] = distances(controller, "/distances", ink)
        layers["capsules"] = capsules(controller, "/capsules")
        return layers

    def draw(self, *, running: bool, rate: float) -> None:
        """Send a picture of the present instant."""
        self._viewer.transport.send(self.frame(running=running, rate=rate))

    def frame(self, *, running: bool, rate: float) -> list[PageCommand]:
        """Return the commands of a picture; see `draw`."""
        session, handles = self._session, self._session.handles
        changed, samples = list(self._changed_field()), list(self._samples())
        tracks = [*map(track_fields, self._run.tracks(self._motion()))]
        poses, places = handles.places()
        level = "warning" if handles.warning or session.over else "info"
        text = session.over or handles.message
        moving = {"t": session.t, "running": running, "rate": rate}
        return [
            *changed,
            _told("pose", tracks=tracks),
            _told("targets", poses=poses, obstacles=places, away=self._away),
            _told("state", **moving, message=text, level=level),
            _told("values", values=handles.settings),
            self._force(),
            *self._other_law(),
            *self._preview.draw(session.controller, session.previews),
            _told("preview", on=session.previews),
            *self._joints(),
            *samples,
        ]

    def _acting_terms(self) -> tuple[NullSpaceField, ...]:
        """Return the terms of the field whose weight is not 0 now."""
        controller = self._session.controller
        if controller is None:
            return ()
        return tuple(
            term
            for term in terms_of(controller.field)
            if term.controls and sample_weight(term.weight, controller.state)[0] > 0.0
        )

    def _present_field(self) -> NullSpaceField | None:
        controller = self._session.controller
        return None if controller is None else controller.field

    def _changed_field(self) -> Iterator[PageCommand]:
        """Draw the field's layers again if the field or its active terms changed."""
        field, acting = self._present_field(), self._acting_terms()
        same = len(acting) == len(self._acting) and all(
            map(operator.is_, acting, self._acting)
        )
        if field is self._field and same:
            return
        self._field, self._acting = field, acting
        self._meta = self._session.meta
        layers = self._layers(self._motion())
        for name in _FIELD_LAYERS:
            yield delete(f"/{name}")
            self._run.layers[name] = layers[name]
            yield from self._run.draw_layer(name, self._size)

    def _motion(self) -> RunMotion:
        """Return the present row as a log."""
        recorder = self._session.recorder
        columns = recorder.rows(recorder.count - 1)
        return RunMotion(self._session.robot, Rollout(columns, self._meta))

    def _setup(self, title: str) -> PageCommand:
        session, handles = self._session, self._session.handles
        controller = session.controller
        state = None if controller is None else controller.state
        return _told(
            "setup",
            title=title,
            targets=[grip.describe(state) for grip in handles.targets.values()],
            obstacles=[grip.describe(state) for grip in handles.obstacles.values()],
            controls=[knob.describe() for knob in handles.knobs.values()],
            plots=[plot.describe() for plot in self._plots],
            joints=joint_names(self._motion().rows) if self._meta["limits"] else [],
            pull=session.pushes is not None,
            loop=session.kind,
        )

    def _joints(self) -> Iterator[PageCommand]:
        """Yield positions, speeds and efforts of the joints relative to their limits.

        Positions from 0 to 1 within the range, speeds and efforts from -1 to 1; null
        where there is no limit.
        """
        limits, recorder = self._meta["limits"], self._session.recorder
        if not limits:
            return
        row = recorder.rows(recorder.count - 1)
        ends = {name: np.array(each, dtype=float) for name, each in limits.items()}
        span = ends["upper"] - ends["lower"]
        yield _told(
            "joints",
            q=_shares((row["joint_positions"][0] - ends["lower"]) / span),
            v=_shares(row["v"][0] / ends["velocity"]),
            tau=_shares(row["tau"][0] / ends["effort"]),
        )

    def _force(self) -> PageCommand:
        pull = self._session.pull()
        if pull is None:
            return _told("force", visible=False)
        point, hand, newtons = pull
        ends = {"from": point.tolist(), "to": hand.tolist()}
        return _told("force", visible=True, newtons=newtons, **ends)

    def _other_law(self) -> Iterator[PageCommand]:
        """Yield the compared law's name, and the robot's configuration under it."""
        other = self._session.other
        law = "" if other is None else other.law
        yield _told("laws", laws=list(self._session.laws), law=law)
        if other is not None or self._compared:
            shown = [] if other is None else [other.q]
            yield self._ghost.show(shown, law)
        self._compared = other is not None

    def _samples(self) -> Iterator[PageCommand]:
        """Yield the rows of the plots since the last picture."""
        recorder = self._session.recorder
        if recorder.count <= self._sent:
            return
        rows, self._sent = recorder.rows(self._sent), recorder.count
        away = unreached(rows, self._meta["tasks"], self._moved)
        self._away = {task.task: words for task in away if (words := task.words(-1))}
        pull = self._session.pull()
        if pull is not None and pull[2] > PULLED:
            held = f"held away by {pull[2]:.0f} N"
            self._away = {
                name: held for name in self._meta["tasks"] if _off(rows, name)
            }
        times = rows["t"]
        self._batch += 1
        values = np.column_stack(
            [curve.values(rows) for plot in self._plots for curve in plot.curves]
            or [np.zeros((len(times), 0))]
        )
        yield page_command(
            "play_samples",
            PLAY,
            f"samples {self._batch % _BATCHES}",
            times=typed_array(times, np.float64),
            values=typed_array(values, np.float32),
        )


def _told(name: str, **fields: Any) -> PageCommand:
    """Return the newest message of a kind to the pages."""
    kind = name if name == "pose" else f"play_{name}"
    return page_command(kind, PLAY, name, **fields)


def _shares(values: Array) -> list[float | None]:
    """Return numbers for a page; None where there is none."""
    return [round(float(x), 4) if np.isfinite(x) else None for x in values]


def _off(rows: dict[str, Array], task: str) -> bool:
    """Return whether a task's error is large enough for a label in the last row."""
    error = rows.get(f"task.{task}.error")
    return error is not None and bool(np.linalg.norm(error[-1]) > REACHED)
