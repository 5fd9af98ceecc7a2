"""A simulation without end that a user steers; without a picture."""

import gc
import logging
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.companions.play.compared import ComparedController
from hsp_control.companions.play.handles import Handles
from hsp_control.companions.play.knobs import Knob
from hsp_control.companions.play.operational_space import operational_space
from hsp_control.companions.play.other_law import OtherLaw, Playing, laws_beside
from hsp_control.companions.viewer.commands import path_element
from hsp_control.config import Experiment
from hsp_control.control.interface import Changes, Controller, LogChannel
from hsp_control.live.hardware import described
from hsp_control.live.simulated_robot import sampled
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.loops import Instant, sampled_loop
from hsp_control.simulation.measures import PULL_COLUMN
from hsp_control.simulation.plants import Plant
from hsp_control.simulation.plants.push import Pushes, Spring

ROW = 0.01
"""Time between two rows of the log, at which messages are processed [s]; whole
periods."""
LONGEST = 1200.0  # maximum recorded time [s]
LARGEST_LOG = 3e8  # maximum size of the log [bytes]
PULL = 300.0  # stiffness of the spring that pulls a link [N/m]
LARGEST_PULL = 100.0  # maximum force of that spring [N]

_REHEARSED = 40  # rows of a rehearsal: beyond the ramps of changes

_log = logging.getLogger(__name__)


class Session:
    """The sampled loop of `simulate`, row by row; a page may change it between rows.

    The log contains everything except a page's forces, so that it repeats the run.
    """

    kind: Literal["simulated"] = "simulated"

    def __init__(self, experiment: Experiment) -> None:
        """Begin at the experiment's start."""
        settings = experiment.scenario.simulation
        if settings.control_period is None:
            raise SimulationError("a session needs a control period")
        self.experiment = experiment
        self.period, self.row = settings.control_period, settings.log_period
        self.plant = sampled(
            experiment.plant, experiment.integrator, settings.control_period
        )
        self.pushes = pushes_of(self.plant)
        if self.pushes is not None:
            self.pushes.reachable = True
        self._point: Array | None = None
        self.previews = False  # whether the page shows a preview of self-motion
        self.reset()

    def reset(self) -> None:
        """Restart: the robot at its start, and every part as declared."""
        experiment, robot = self.experiment, self.experiment.robot
        memo: dict[int, Any] = {id(robot): robot}
        self.controller: Controller = deepcopy(experiment.controller, memo)
        self.compensated = ComparedController(self.controller, experiment.compensation)
        self.other: OtherLaw | None = None
        self.let_go()
        self._unrepeatable = ""
        rows, plan = self._rows(), experiment.scenario.plan
        times = [k * self.row for k in range(rows)]
        chain = ControlChain(self.compensated, plan, experiment.scenario.estimators)
        chain.begin(self.plant.inertial())
        self._loop: Iterator[Instant] = sampled_loop(
            chain, self.plant, round(self.row / self.period), times,
            experiment.q0, experiment.v0,
        )  # fmt: skip
        scene = self.controller.scene
        self.recorder = LogWriter(self.controller, scene, rows, chain.plan)
        self.over = ""
        self._step()
        self.handles = Handles(self.controller, self.period)
        law = Knob(
            "operational", "Null space", "Operational-space law instead", "", False,
            0.0, 1.0, self._compare, "Its self-motion follows the field with a lag.",
        )  # fmt: skip
        if self.controller.field.controls:
            self.handles.add(law)
        gc.collect()  # the old run has reference cycles, and would stay in memory

    def rehearse(self) -> None:
        """Execute every command once, and restart: the play then does none first."""
        self.handles.rehearse()
        for _ in range(_REHEARSED):
            self.advance()
        self.reset()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.experiment.robot

    @property
    def title(self) -> str:
        """The title of the scene."""
        return self.experiment.scenario.title or self.robot.name

    @property
    def t(self) -> float:
        """The time of the present row [s]."""
        return self.controller.state.t

    def advance(self) -> None:
        """Advance to the next row; an error ends the run, not the session."""
        if not self.over:
            self._step()
            self.handles.turn_knobs()
            self._step_other()

    def _step(self) -> None:
        try:
            instant = next(self._loop, None)
            if instant is None:
                self.over = f"the log is full at t = {self.t:.0f} s; reset to go on"
                return
            state, output, tau, own = instant
            others = self.plant.log_channels(state.t, state.q, state.v, tau)
            pulled = self.pull()
            force = LogChannel(0.0 if pulled is None else pulled[2], "N", "of a hand")
            channels = {**own, **others, PULL_COLUMN: force}
            self.recorder.record(state, output, tau, channels)
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # a user's task or field may raise anything
            self.over = f"{described(error)}; reset to go on"
            _log.warning("%s", described(error))

    # -- another law beside it --------------------------------------------------------

    @property
    def laws(self) -> list[str]:
        """The laws with which it can be compared; none if it has a plan."""
        if self.experiment.scenario.plan is not None:
            return []
        operational = self.compensated.compared is operational_space
        return laws_beside(self.controller, operational=operational)

    def compare_with(self, law: str | None) -> None:
        """Compare with another law from now on; None: with none."""
        if law is not None and law not in self.laws:
            raise ValueError(f"there is no {law!r} to compare with")
        if law is None:
            self.other = None
            return
        playing = Playing(self.compensated, self.handles, self.plant)
        times = [self.t + k * self.row for k in range(self.rows_left)]
        periods = round(self.row / self.period)
        self.other = OtherLaw(law, playing, times, periods, shared=self)

    def _step_other(self) -> None:
        """Advance the other law; if it fails, only the comparison ends."""
        if self.other is None:
            return
        try:
            self.other.advance()
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # the other law may fail where this one does not
            self.handles.say(f"{self.other.law}: {described(error)}", warning=True)
            self.other = None

    # -- messages ---------------------------------------------------------------------

    def receive(self, message: Mapping[str, Any]) -> None:
        """Execute a command: ``pull`` at a link and ``let_go``, or see `Handles`."""
        try:
            match message:
                case {"do": "pull", "path": str(path), "point": list(point),
                      "to": list(hand)}:  # fmt: skip
                    self._pull(path, _vector(point), _vector(hand))
                case {"do": "let_go" | "left"}:
                    self.let_go()
                case {"do": "preview", "on": bool(on)}:
                    self.previews = on
                case {"do": "compare", "law": str(law)}:
                    self.compare_with(law or None)
                case _:
                    self.handles.receive(message)
                    if self.other is not None:
                        self.other.receive(message)
        except (ValueError, TypeError, OverflowError) as error:
            self.handles.say(str(error), warning=True)
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # a user's task or field may raise anything
            self.over = f"{described(error)}; reset to go on"
            _log.warning("%s", described(error))

    def _compare(self, _at: Changes, operational: bool) -> None:
        """Follow another law; it is part neither of the controller nor of its log."""
        self.compensated.compared = operational_space if operational else None
        self.other = None  # its law may be the same now
        if operational:
            self._unrepeatable = "the operational-space law was tried"

    # -- pulling ----------------------------------------------------------------------

    def _pull(self, path: str, point: Array, hand: Array) -> None:
        if self.pushes is None:
            raise ValueError(
                "this plant accepts no external force, so no link can be pulled"
            )
        if self._point is None or not np.array_equal(point, self._point):
            joint = _joint_of(self.experiment.robot, path)
            place = self.controller.state.data.oMi[joint]
            self._point, self._unrepeatable = point, "a link was pulled"
            self.pushes.spring = Spring(
                joint, place.actInv(point), hand, PULL, LARGEST_PULL
            )
        spring = self.pushes.spring
        assert spring is not None
        spring.hand = hand

    def let_go(self) -> None:
        """Stop pulling."""
        self._point = None
        if self.pushes is not None:
            self.pushes.spring = None

    def pull(self) -> tuple[Array, Array, float] | None:
        """Return the pulled point and the hand, both (3,) [m], and the force [N]."""
        spring = None if self.pushes is None else self.pushes.spring
        if spring is None:
            return None
        place: pin.SE3 = self.controller.state.data.oMi[spring.joint]
        point = np.asarray(place.act(spring.point))
        return point, spring.hand, float(np.linalg.norm(spring.force(point)))

    # -- the log ----------------------------------------------------------------------

    @property
    def meta(self) -> dict[str, Any]:
        """The meta data of the rows so far."""
        return self.recorder.meta("", "", plant=self.plant.describe())

    def rollout(self) -> Rollout:
        """Return the log so far; `hsp run` repeats it, unless a link was pulled."""
        experiment = self.experiment
        config = experiment.config
        if config is not None:
            whole = int(self.t / self.row + 1e-6)  # Ctrl-C may occur within a row
            config["simulation"]["duration"] = max(whole, 1) * self.row
        lost = {"changes_lost": self._unrepeatable} if self._unrepeatable else {}
        return self.recorder.rollout(
            "completed",
            self.over,
            name=f"{experiment.name}, played",
            title=experiment.scenario.title,
            config=config,
            plant=self.plant.describe(),
            **lost,
        )

    @property
    def rows_left(self) -> int:
        """The number of rows that still fit into the log, the present one included."""
        return self._rows() - self.recorder.count + 1

    def _rows(self) -> int:
        probe = LogWriter(self.controller, self.controller.scene, 1)
        size = sum(8 * int(np.prod(a.shape[1:])) for a in probe.rows(0).values())
        return int(min(LONGEST / self.row, LARGEST_LOG / size)) + 1


def pushes_of(plant: Plant) -> Pushes | None:
    """Return the part of a plant that pushes the robot, also of a wrapped plant."""
    inner: object = plant
    while inner is not None:
        pushes = getattr(inner, "pushes", None)
        if isinstance(pushes, Pushes):
            return pushes
        inner = getattr(inner, "plant", None)
    return None


def _vector(values: list[Any]) -> Array:
    vector = np.array(values, dtype=float)
    if vector.shape != (3,) or not (np.abs(vector) < 1e3).all():
        raise ValueError(f"a point needs x, y and z in metres; got {values}")
    return vector


def _joint_of(robot: Robot, path: str) -> int:
    """Return the joint of a node of the scene, ``/robot/JOINT/...``."""
    names = [path_element(name) for name in robot.model.names]
    parts = path.strip("/").split("/")
    if len(parts) < 2 or parts[0] != "robot" or parts[1] not in names[1:]:
        raise ValueError(f"{path!r} is not a moving link")
    return names.index(parts[1])
