"""An experiment: the objects of a configuration, ready to run."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigError, SimulationError
from hsp_control.common.resources import bundled_configs
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.config.build_compensation import build_compensation, check_rates
from hsp_control.config.build_plant import build_plant
from hsp_control.config.build_robot import build_robot, build_start
from hsp_control.config.document import Document
from hsp_control.config.ground import put_on_ground
from hsp_control.config.located_scene import located_scene
from hsp_control.config.models.plant import MujocoPlantModel
from hsp_control.config.models.simulation import Dop853Model, Rk4Model
from hsp_control.config.scenario import Scenario
from hsp_control.config.validation import validate
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.changes import Change
from hsp_control.control.compensation import Compensation, RateFinding
from hsp_control.control.composition import Base
from hsp_control.control.controller import Controller
from hsp_control.declaration.named import keyed
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.null_space.fields import FieldSum, NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import IdentityMetric, Metric
from hsp_control.robot import Robot
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import packaged_folders
from hsp_control.robot.integrators import Dop853, Integrator, Rk4, SemiImplicitEuler
from hsp_control.simulation import Rollout, simulate
from hsp_control.simulation.plants import Plant
from hsp_control.simulation.recorder import Recorder
from hsp_control.simulation.simulate import check_steps, count_rows
from hsp_control.tasks import Task


@dataclass(frozen=True, init=False, eq=False)
class Experiment:
    """A controller, and what it is tried on: the objects of one configuration.

    It is made of the same parts in Python and in YAML: `load_experiment` reads what
    `to_yaml` writes.

    Attributes:
        name: The configuration's name, for file names.
        scenario: The checked configuration.
        robot: The robot.
        controller: Its controller.
        scene: Its obstacles.
        q0: Start configuration, shape (nq,).
        v0: Start velocity, shape (nv,).
        integrator: The integrator of the simulation.
        plant: The simulated system that the efforts act on.
        compensation: Compensators for differences between plant and model.
        rate_findings: Gains that are high for the control period.
    """

    name: str
    scenario: Scenario
    robot: Robot
    controller: Controller
    scene: Scene
    q0: Array
    v0: Array
    integrator: Integrator
    plant: Plant
    compensation: Compensation
    rate_findings: tuple[RateFinding, ...]

    def __init__(
        self,
        robot: str | Mapping[str, object],
        tasks: Sequence[Task],
        field: NullSpaceField | None = None,
        *,
        null_space_gain: ArrayLike = 10.0,
        metric: Metric | None = None,
        singularity_threshold: float = 0.03,
        limits: Limits | None = None,
        contacts: Sequence[Contact] = (),
        base: Base | None = None,
        scene: Scene | Iterable[Obstacle] = (),
        changes: Sequence[Change] = (),
        name: str = "experiment",
        **settings: object,
    ) -> None:
        """Build an experiment.

        Args:
            robot: The robot's name or the path of its URDF; or the keys of YAML's
                ``robot``.
            tasks: The tasks; this and all others up to ``changes`` as for `Controller`.
            field: The null-space field.
            null_space_gain: K_N [1/s].
            metric: The joint-space metric.
            singularity_threshold: Singular value below which the inverse is bounded.
            limits: Limits on efforts and motion.
            contacts: The contacts of a floating base.
            base: What else moves a floating base.
            scene: The obstacles.
            changes: Changes while running.
            name: Its name, for file names.
            **settings: All other keys of a configuration, as mappings: ``start``,
                ``plant``, ``compensation``, ``simulation``, ``live``, ``view``,
                ``title``, ``description``.

        Raises:
            HspControlError: If a part or a key is wrong; see `load_experiment`.
        """
        null_space = {
            "gain": null_space_gain,
            "metric": IdentityMetric() if metric is None else metric,
            "fields": () if field is None else terms_of(field),
            "singularity_threshold": singularity_threshold,
        }
        data = {
            "robot": {"name": robot} if isinstance(robot, str) else robot,
            "tasks": keyed(tasks),
            "null_space": null_space,
            "limits": limits,
            "contacts": keyed(contacts),
            "base": base,
            "scene": scene if isinstance(scene, Scene) else Scene(scene),
            "changes": tuple(changes),
            **settings,
        }
        vars(self).update(vars(build(Document(data, {}, name))))

    @property
    def config(self) -> dict[str, Any] | None:
        """The whole configuration as data, for the log; None if a part is no data."""
        try:
            config: dict[str, Any] = plain_data(self.scenario, defaults=True)
        except ConfigError:
            return None
        return config

    def to_yaml(self) -> str:
        """Return the configuration as YAML; `load_experiment` builds the same from it.

        Raises:
            ConfigError: If a part is not data: a Python function, or a class that has
                no YAML type.
        """
        text: str = yaml.safe_dump(
            plain_data(self.scenario),
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=88,
        )
        return text

    def run(
        self,
        on_progress: Callable[[float], None] | None = None,
        on_row: Callable[[Recorder], None] | None = None,
    ) -> Rollout:
        """Simulate the experiment; see `simulate` for arguments and errors."""
        settings = self.scenario.simulation
        return simulate(
            self.controller,
            self.q0,
            self.v0,
            duration=settings.duration,
            control_period=settings.control_period,
            log_period=settings.log_period,
            integrator=self.integrator,
            plant=self.plant,
            compensation=self.compensation,
            scene=self.scene,
            on_progress=on_progress,
            on_row=on_row,
            meta={
                "name": self.name,
                "title": self.scenario.title,
                "config": self.config,
            },
        )


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


def read_document(
    source: str | PathLike[str] | dict[str, Any],
    *,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Document:
    """Return the configuration's data with the location of each key.

    See `load_experiment` for the arguments.

    Raises:
        ConfigError: If there is no such configuration or it is not plain YAML.
        LogError: If it is a log that cannot be read.
    """
    document = _read(source)
    if strict:
        own = [] if isinstance(source, dict) else [Path(document.name).parent]
        document.access = only_within([*own, *packaged_folders(), *allow])
        document.packages = frozenset(map(str, allow))
    return document


def _read(source: str | PathLike[str] | dict[str, Any]) -> Document:
    if isinstance(source, dict):
        return Document(source, {}, "configuration")
    path = Path(source)
    if path.suffix in {".npz", ".journal"}:
        run = Rollout.load(path)
        if run.config is None:
            raise ConfigError(
                f"{path}: this log was made from Python and contains no configuration"
            )
        if lost := run.meta.get("changes_lost"):
            raise ConfigError(
                f"{path}: the run cannot be repeated, because changes were made while "
                f"it ran that are not data: {lost}"
            )
        made = run.meta.get("changes") or []
        return Document(run.config | {"changes": made}, {}, str(path))
    known = bundled_configs()
    if path.suffix in {".yaml", ".yml"} or _is_file(path):
        return Document.read(path)
    if str(source) in known:
        return Document.read(known[str(source)])
    raise ConfigError(
        f"no configuration {str(source)!r}{did_you_mean(str(source), known)} "
        f"(give the path of a .yaml file, or one of: {listing(known)})"
    )


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # not a valid file name
        return False


def build(document: Document) -> Experiment:
    """Build the experiment of a configuration.

    Raises:
        HspControlError: If the configuration is wrong; see `load_experiment`.
    """
    scenario = validate(document, Scenario)
    folder = Path(document.name).resolve().parent
    robot, scenario = build_robot(document, scenario, folder)
    q0 = build_start(document, scenario.start, robot)
    with document.at():
        if scenario.start.ground is not None:
            contacts = scenario.contacts.values()
            q0 = put_on_ground(scenario.start.ground, contacts, robot, q0)
        scene = located_scene(scenario.scene, folder, document.access)
        scenario = scenario.model_copy(update={"scene": scene})
        fields, null_space = scenario.null_space.fields, scenario.null_space
        controller = Controller(
            robot,
            tuple(scenario.tasks.values()),
            fields[0] if len(fields) == 1 else FieldSum(fields) if fields else None,
            null_space_gain=null_space.gain,
            metric=null_space.metric,
            singularity_threshold=null_space.singularity_threshold,
            limits=scenario.limits,
            contacts=tuple(scenario.contacts.values()),
            base=scenario.base,
            scene=scene,
            start=q0,
            changes=scenario.changes,
        )
    start = robot.state(0.0, q0, np.zeros(robot.nv))
    velocity = scenario.start.velocity
    with document.at("start", "velocity"):
        if velocity == "flow":
            v0 = controller.flow(0.0, q0)
        else:
            v0 = robot.check_tangent(start.v if velocity == "rest" else velocity, "v0")
    if controller.limits is not None:
        with document.at("start"):
            controller.limits.check_start(q0, v0)
    integrator = _integrator(document, scenario)
    plant, scenario = build_plant(document, scenario, folder, robot, integrator)
    compensation = build_compensation(document, scenario, controller)
    rates = check_rates(document, scenario, controller, compensation, q0)
    return _experiment(
        name=Path(document.name).stem,
        scenario=scenario,
        robot=robot,
        controller=controller,
        scene=scene,
        q0=q0,
        v0=v0.copy(),
        integrator=integrator,
        plant=plant,
        compensation=compensation,
        rate_findings=rates,
    )


def _experiment(**attributes: object) -> Experiment:
    experiment = object.__new__(Experiment)
    vars(experiment).update(attributes)
    return experiment


def _integrator(document: Document, scenario: Scenario) -> Integrator:
    settings = scenario.simulation
    with document.at("simulation"):
        count_rows(settings.duration, settings.log_period, settings.control_period)
        if isinstance(plant := scenario.plant, MujocoPlantModel):
            check_steps(settings.duration, plant.timestep, "plant.timestep")
    model = settings.integrator
    if isinstance(model, Dop853Model):
        return Dop853(model.rtol, model.atol)
    whole = settings.control_period or settings.log_period
    ratio = whole / model.step
    with document.at("simulation", "integrator", "step"):
        check_steps(settings.duration, model.step, "step")
        if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
            period = "control_period" if settings.control_period else "log_period"
            raise SimulationError(
                f"{model.step:g} s is not an integer fraction of {period} = {whole:g} s"
            )
    return (
        Rk4(model.step)
        if isinstance(model, Rk4Model)
        else SemiImplicitEuler(model.step)
    )
