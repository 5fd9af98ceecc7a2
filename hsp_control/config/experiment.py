"""An experiment: the objects of a configuration, ready to run."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count
from os import PathLike
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Literal, NoReturn, Self

import yaml
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    ConfigError,
    ImmutableError,
    ModelError,
)
from hsp_control.common.keywords import suggesting
from hsp_control.config.document import Document, read_document
from hsp_control.config.loaded_scenario import LoadedScenario, load_scenario
from hsp_control.config.scenario import Scenario, ViewSettings
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.changes import Change
from hsp_control.control.compensation import Compensation, RateFinding, check_rate
from hsp_control.control.controller import Controller
from hsp_control.control.estimation import Estimator, begun
from hsp_control.control.fitting import Base
from hsp_control.control.plans import MotionPlan
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.own_modules import own_modules
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.live.settings import LiveSettings
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot
from hsp_control.robot.description.robot_description import RobotDescription
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation import Rollout, simulate
from hsp_control.simulation.declared_run import controller_data
from hsp_control.simulation.initial_state import InitialState
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.model_errors import ModelErrors, model_errors
from hsp_control.simulation.plants import Plant, PlantPart, SampledPlant, is_exact
from hsp_control.simulation.simulate import (
    SimulationSettings,
    check_steps,
    default_integrator,
)
from hsp_control.tasks import Task
from hsp_control.trajectories.streams.streamed import Streamed


class Experiment:
    """A controller and its plant: the objects of one configuration.

    It has the same parts in Python and in YAML: `load_experiment` reads the output of
    `to_yaml`. It is immutable.

    Attributes:
        name: The configuration's name, for file names.
        scenario: The checked configuration.
        robot: The robot.
        controller: Its controller.
        scene: Its obstacles.
        q0: Start configuration, shape (nq,).
        v0: Start velocity, shape (nv,).
        plant: The simulated system on which the efforts act.
        rate_findings: Gains that are high for the control period.
    """

    name: str
    scenario: Scenario
    robot: Robot
    controller: Controller
    scene: Scene
    q0: Array
    v0: Array
    plant: Plant
    rate_findings: tuple[RateFinding, ...]

    def __init__(
        self,
        robot: str | Robot | RobotDescription,
        tasks: Sequence[Task],
        field: NullSpaceField | None = None,
        *,
        null_space_gain: ArrayLike = 10.0,
        metric: Metric | None = None,
        singularity_threshold: float = 0.03,
        limits: Limits | None = Limits(),
        contacts: Sequence[Contact] = (),
        base: Base | None = None,
        plan: MotionPlan | None = None,
        scene: Scene | Iterable[Obstacle] = (),
        changes: Sequence[Change] = (),
        start: InitialState | Literal["auto"] | None = None,
        plant: PlantPart | str = "rigid_body",
        compensation: Compensation | None = None,
        estimators: Sequence[Estimator] = (),
        simulation: SimulationSettings | None = None,
        live: LiveSettings | None = None,
        view: ViewSettings | None = None,
        title: str = "",
        description: str = "",
        name: str = "experiment",
    ) -> None:
        """Build an experiment.

        Args:
            robot: The robot from `Robot.load`, or its name, the path of its URDF, or
            its description.
            tasks: The tasks; these and all arguments up to ``changes`` as for
            `Controller`.
            field: The null-space field.
            null_space_gain: K_N [1/s].
            metric: The joint-space metric.
            singularity_threshold: Singular value below which the inverse is bounded.
            limits: Limits on efforts and motion; None: no limits.
            contacts: The contacts of a floating base.
            base: The actuation of a floating base without contacts.
            plan: The plan that writes references and switches contacts; it adds its own
                tasks.
            scene: The obstacles; those of fields and limits are added.
            changes: Changes at run time.
            start: The initial state; at home and at rest by default. ``auto``: a good
            configuration is searched.
            plant: The simulated system; the controller's own model by default.
            compensation: Compensators for model errors.
            estimators: Estimators that complete each measurement.
            simulation: Duration, periods and integrator.
            live: Settings of a live run.
            view: Settings of the 3-D view.
            title: The experiment in one line.
            description: A longer description.
            name: Its name, for file names.

        Raises:
            HspControlError: If a part is wrong, or does not fit the others; see
                `load_experiment`.
        """
        given = {
            "start": start,
            "compensation": compensation,
            "simulation": simulation,
            "live": live,
            "view": view,
        }
        robot = _described(robot)
        data = {
            "title": title,
            "description": description,
            **controller_data(
                *(robot, tasks, field, null_space_gain, metric, singularity_threshold),
                *(limits, contacts, base, scene, changes),
            ),
            "plan": plan,
            "estimators": estimators,
            "plant": plant,
            **{key: part for key, part in given.items() if part is not None},
        }
        self._compose(load_scenario(Document(data, {}, name)))

    @classmethod
    def of(cls, loaded: LoadedScenario) -> Self:
        """Build the experiment of a configuration whose robot is loaded.

        Raises:
            HspControlError: If the configuration is wrong; see `load_experiment`.
        """
        experiment = cls.__new__(cls)
        experiment._compose(loaded)
        return experiment

    def _compose(self, loaded: LoadedScenario) -> None:
        """Build the objects, in the order of their dependences."""
        document, scenario, robot, scene = loaded
        folder = Path(document.name).resolve().parent
        contacts = tuple(scenario.contacts.values())
        null_space, tasks = scenario.null_space, tuple(scenario.tasks.values())
        # First: its engine may not be installed, and the rest may take long.
        scenario = replace(scenario, plant=scenario.plant.located(folder))
        plant = _plant(document, scenario, robot)
        with document.at("start"):
            q0 = scenario.start.configuration_of(
                robot, contacts, tasks, scene, null_space.singularity_threshold
            )
            begin = scenario.start
            if begin.is_found:  # a repeated run begins there, too
                begin = InitialState(
                    configuration=q0,
                    velocity=begin.velocity,
                    relative_to=begin.relative_to,
                )
                scenario = replace(scenario, start=begin)
            relative_to = begin.relative_to_of(robot, q0)
        with document.at():
            limits = scenario.limits
            if scenario.plan is not None:
                tasks, contacts = scenario.plan.parts(robot, tasks, contacts)
                limits = scenario.plan.limits(limits)
            controller = Controller(
                robot,
                tasks,
                null_space.field,
                null_space_gain=null_space.gain,
                metric=null_space.metric,
                singularity_threshold=null_space.singularity_threshold,
                limits=limits,
                contacts=contacts,
                base=scenario.base,
                scene=scene,
                start=relative_to,
                changes=scenario.changes,
            )
        with document.at("start"):
            t0 = scenario.simulation.start_time
            v0 = begin.velocity_of(controller, t0, q0)
            if controller.limits is not None:
                controller.limits.check_start(q0, v0)
        with document.at():  # errors of the first step would have no location
            controller.check_derivatives(robot.state(t0, q0, v0))
        if scenario.plan is not None:
            with document.at("plan"):
                scenario.plan.begin(controller).start(robot.state(t0, q0, v0))
        with document.at():
            begun(scenario.estimators, controller, plant.inertial())
        _check_compensation(document, scenario, controller)
        with document.at():
            rates = _rate_findings(scenario, controller, q0, plant)
        vars(self).update(
            name=Path(document.name).stem,
            scenario=scenario,
            robot=robot,
            controller=controller,
            scene=scene,
            q0=q0,
            v0=v0,
            plant=plant,
            rate_findings=rates,
        )

    def __setattr__(self, attribute: str, value: object) -> NoReturn:
        raise ImmutableError(
            f"Experiment.{attribute} cannot be assigned: build another experiment, or "
            "change the controller while it runs with experiment.controller.at(t)"
        )

    @property
    def compensation(self) -> Compensation:
        """Compensators for differences between plant and model, which depend on both.

        A real robot uses those of its `scenario` instead, which do not depend on the
        plant.
        """
        own = self.scenario.compensation
        return own.suited(self.controller, *self._loop)

    @property
    def on_observer(self) -> str:
        """A few words: whether there is a momentum observer, its rate, and why."""
        own = self.scenario.compensation
        return own.on_observer(self.controller, *self._loop)

    @cached_property
    def model_errors(self) -> ModelErrors | None:
        """The model errors that the loop tolerates at the start.

        For a robot that differs from its model. None without a control period, and if
        `model_errors` has no result.
        """
        period = self.scenario.simulation.control_period
        if period is None:
            return None
        plant = self.scenario.plant
        return model_errors(
            self.controller.preview(),
            self.q0,
            period,
            self.scenario.compensation,
            effort_delay=plant.effort_delay,
            sensor_delay=plant.sensor_delay,
            effort_lag=plant.effort_lag,
        )

    @property
    def _loop(self) -> tuple[float | None, bool]:
        """The control period [s], if there is one, and whether the plant is exact."""
        period = self.scenario.simulation.control_period
        return period, is_exact(self.plant, self.robot)

    @property
    def integrator(self) -> Integrator:
        """The integrator of the simulation."""
        return _integrator(self.scenario)

    @property
    def config(self) -> dict[str, Any] | None:
        """The whole configuration as data, for the log; None if a part is not data."""
        try:
            config: dict[str, Any] = plain_data(self.scenario, defaults=True)
        except ConfigError:
            return None
        return config | {"imports": self._imports}

    @property
    def _imports(self) -> list[str]:
        """Code that declares types of this experiment, for readers elsewhere."""
        own = [*self.scenario.imports, *own_modules(self.scenario)]
        return list(dict.fromkeys(own))

    def to_yaml(self) -> str:
        """Return the configuration as YAML; `load_experiment` builds the same from it.

        Raises:
            ConfigError: If a part is not data: a Python function, or a class that has
                no YAML type.
        """
        data: dict[str, Any] = plain_data(self.scenario)
        if self._imports:
            data["imports"] = self._imports
        text: str = yaml.safe_dump(
            data,
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=88,
        )
        return text

    @property
    def live_sources(self) -> tuple[str, ...]:
        """The addresses at which its streams receive messages, in real time."""
        streams = parts_within(self.scenario, Streamed)
        return tuple(str(each.source) for each in streams if each.live)

    def run(
        self,
        on_progress: Callable[[float], None] | None = None,
        on_row: Callable[[LogWriter], None] | None = None,
        log: str | Path | None = None,
    ) -> Rollout:
        """Simulate the experiment; see `simulate` for arguments and errors.

        If another process feeds a stream, the run advances in real time.
        """
        settings = self.scenario.simulation
        if self.live_sources:
            on_row = _in_real_time(settings.log_period, on_row)
        return simulate(
            self.controller,
            self.q0,
            self.v0,
            duration=settings.duration,
            control_period=settings.control_period,
            log_period=settings.log_period,
            integrator=self.integrator,
            plant=self.plant,
            compensation=self.scenario.compensation,
            plan=self.scenario.plan,
            estimators=self.scenario.estimators,
            scene=self.scene,
            start_time=settings.start_time,
            check_rate=False,  # checked when it was built, or disabled
            on_progress=on_progress,
            on_row=on_row,
            log=log,
            meta={
                "name": self.name,
                "title": self.scenario.title,
                "config": self.config,
            },
        )


@suggesting
def load_experiment(
    source: str | PathLike[str] | dict[str, Any],
    *overrides: str,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Experiment:
    """Build an experiment from a configuration.

    Args:
        source: The name of a bundled configuration, a path to a YAML file or to a log
            (whose stored configuration is used), or the data itself.
        overrides: Values to change, each ``key.path=value``.
        strict: For untrusted files: the files that they name must be in the source's
            own folder, bundled, or in an allowed folder, and the types that they name
            must be those of this package, or of an allowed one.
        allow: Further allowed folders and packages, for strict reading.

    Raises:
        ConfigError: If the configuration does not follow the schema.
        AccessError: If it is read strictly and names a file elsewhere.
        HspControlError: If a name does not exist or a value does not fit; the message
            contains the location.
    """
    document = read_document(source, strict=strict, allow=allow)
    for assignment in overrides:
        document.override(assignment)
    return build(document)


def build(document: Document) -> Experiment:
    """Build the experiment of a configuration."""
    return Experiment.of(load_scenario(document))


def _described(robot: str | Robot | RobotDescription) -> RobotDescription:
    if isinstance(robot, str):
        return RobotDescription(robot)
    if not isinstance(robot, Robot):
        return robot
    if robot.description is None:
        raise ModelError(
            f"{robot.name} was not loaded by Robot.load, so that no configuration can "
            "name it; give a name, a path or a RobotDescription"
        )
    return robot.description


def _plant(document: Document, scenario: Scenario, robot: Robot) -> Plant:
    """Return the plant, with the required control period and steps."""
    settings = scenario.simulation
    if (step := scenario.plant.longest_step) is not None:
        with document.at("simulation"):
            check_steps(settings.duration, step, "plant.timestep")
    with document.at("plant"):
        integrator = _integrator(scenario)
        plant = scenario.plant.build(robot, integrator, access=document.access)
    if isinstance(plant, SampledPlant) and settings.control_period is None:
        raise document.error(
            ("plant",),
            "this plant needs efforts that are held for a period: set "
            "simulation.control_period [s], for example to 0.001",
        )
    return plant


def _integrator(scenario: Scenario) -> Integrator:
    settings = scenario.simulation
    own = default_integrator(scenario.plant, settings.control_period)
    return settings.integrator or own


def _check_compensation(
    document: Document, scenario: Scenario, controller: Controller
) -> None:
    """Check the compensation against the robot, its tasks and contacts."""
    compensation = scenario.compensation
    if compensation.names and scenario.simulation.control_period is None:
        raise document.error(
            ("compensation",),
            "compensation acts once per control period: set simulation.control_period "
            "[s], for example to 0.001",
        )
    with document.at("compensation"):
        compensation.check(controller.robot, controller.tasks, controller.contacts)


def _rate_findings(
    scenario: Scenario, controller: Controller, q0: Array, moving: Plant
) -> tuple[RateFinding, ...]:
    """Check that the loop is stable at its rate; return gains that are high for it."""
    settings, plant = scenario.simulation, scenario.plant
    if settings.control_period is None or not settings.check_rate:
        return ()
    period, exact = settings.control_period, is_exact(moving, controller.robot)
    found = check_rate(
        controller,
        q0,
        period,
        scenario.compensation.decided(controller, period, exact),
        effort_delay=plant.effort_delay,
        effort_lag=plant.effort_lag,
        sensor_delay=plant.sensor_delay,
        plant=moving.robot,
    )
    return tuple(found)


def _in_real_time(
    period: float, on_row: Callable[[LogWriter], None] | None
) -> Callable[[LogWriter], None]:
    """Return a function, called after every row, that keeps a run in real time."""
    rows, begin = count(), monotonic()

    def wait(recorder: LogWriter) -> None:
        nonlocal begin
        if on_row is not None:
            on_row(recorder)
        row = next(rows)
        if row == 0:
            begin = monotonic()  # after the calls are bound
        sleep(max(begin + row * period - monotonic(), 0.0))

    return wait
