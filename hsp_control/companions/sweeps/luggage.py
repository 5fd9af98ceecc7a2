"""The data sent to the workers, so that they need no file of this computer.

It contains the configuration with the files that it names, the robot unless an
installed package has it, and the Python files that declare the user's types. Dask
passes it to every worker when it joins, also to one that replaces another.
"""

import json
import logging
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from shutil import rmtree
from threading import RLock
from typing import Any
from uuid import uuid4

from distributed import WorkerPlugin

from hsp_control.common.entry_points import entry_points
from hsp_control.common.errors import SweepError
from hsp_control.common.resources import is_file
from hsp_control.companions.sweeps.plan import SweepPlan, changed, fingerprint
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.config.own_code import located_imports
from hsp_control.control.interface import StartWarning
from hsp_control.declaration import Part
from hsp_control.declaration.imported import import_file, is_file_name
from hsp_control.robot import Robot
from hsp_control.robot.recorded import robot_record
from hsp_control.simulation.log_writer import versions

_log = logging.getLogger(__name__)

_PLACE = "<luggage>"  # placeholder for the folder that a worker unpacks
_PREFIX = "hsp-sweep-"  # of that folder
_LARGEST = 100_000_000  # maximum size of a file that is sent [bytes]

reading = False
"""Whether this process, a worker, is running a script for the types in it."""
_LOCK = RLock()  # a worker may have several threads


class SweepReachedError(BaseException):
    """A script that a worker runs for its types has reached its own sweep."""


class Luggage(WorkerPlugin):  # type: ignore[misc]
    """Everything that a worker needs for the runs of a sweep."""

    def __init__(
        self, plan: SweepPlan, robot: Robot, identity: dict[str, Any],
        imports: Iterable[str],
    ) -> None:  # fmt: skip
        """Pack it.

        Args:
            plan: The sweep.
            robot: The robot of its first run.
            identity: The sweep's identity.
            imports: Python files and modules to import first, besides those that the
                configuration lists.

        Raises:
            SweepError: If a type that the runs use has no file.
        """
        self.name = f"{_PREFIX}{uuid4().hex}"  # also of its keys on a shared scheduler
        self.versions = versions()
        self.files: dict[str, bytes] = {}
        named = {*_strings([plan.base.to_dict(), *(_listed(f) for f in plan.factors)])}
        base = Path(plan.base.name).resolve()
        listed = plan.base.to_dict().get("imports") or ()
        code = [*imports, *(located_imports(listed, base.parent))]
        files = [Path(each).resolve() for each in code if is_file_name(each)]
        modules = [each for each in code if not is_file_name(each)]
        scripts = dict.fromkeys([*files, *_declaring(named, modules)])
        self.scripts = [
            (self._packed(script), str(script.parent)) for script in scripts
        ]
        # Absolute, because a worker may have another working folder.
        self.config = str(base)
        self.data = {
            key: value if key == "robot" else self._with_files(value, base.parent)
            for key, value in plan.base.to_dict().items()
        }
        self.data["imports"] = list(dict.fromkeys(modules))
        self.record, self.model = plan.base.recorded_robot, ""
        if not plan.varies_robot:
            self.model = identity["model"]
            self.record = self.record or _record(robot)

    def _packed(self, file: Path) -> str:
        """Add a file, and return its name in the luggage."""
        name = f"{len(self.files)}/{file.name}"
        self.files[name] = file.read_bytes()
        return name

    def _with_files(self, value: Any, folder: Path) -> Any:
        """Return data with the names of files replaced by those in the luggage."""
        if isinstance(value, dict):
            return {k: self._with_files(each, folder) for k, each in value.items()}
        if isinstance(value, list):
            return [self._with_files(each, folder) for each in value]
        if not isinstance(value, str) or not Path(value).suffix:
            return value
        file = folder / value
        if not is_file(file) or file.stat().st_size > _LARGEST:
            return value
        return f"{_PLACE}/{self._packed(file)}"

    # --- on a worker ------------------------------------------------------------------

    def setup(self, worker: Any) -> None:
        """Unpack it."""
        # Dask removes the folder of a killed worker.
        self.folder = Path(worker.local_directory) / self.name
        for name, content in self.files.items():
            (self.folder / name).parent.mkdir(parents=True)
            (self.folder / name).write_bytes(content)
        self._base: Document | None = None
        # A diverging run overflows, which its row reports. Warnings about the start
        # were printed by the process that started the sweep.
        warnings.simplefilter("ignore", RuntimeWarning)
        warnings.simplefilter("ignore", StartWarning)

    def teardown(self, worker: Any) -> None:
        """Remove the unpacked files."""
        rmtree(self.folder, ignore_errors=True)

    def experiment(self, changes: Any) -> Experiment:
        """Return the objects of a run.

        Raises:
            SweepError: If the computer is not suitable for the sweep.
            HspControlError: If the run cannot be built.
        """
        with _LOCK:
            if self._base is None:
                self._base = self._unpacked()
        experiment = build(changed(self._base, changes))
        if self.model and fingerprint(experiment.robot) != self.model:
            raise SweepError(
                f"{experiment.robot.name} has a different model on a worker's computer"
            )
        return experiment

    def _unpacked(self) -> Document:
        if self.versions != (here := versions()):
            told = ", ".join(
                f"{name} {here[name]} instead of {self.versions[name]}"
                for name in here
                if here[name] != self.versions[name]
            )
            raise SweepError(f"a worker has {told}")
        # A script may import another, or a module beside it, where there is one.
        folders = [str((self.folder / name).parent) for name, _ in self.scripts]
        sys.path += [*folders, *(folder for _, folder in self.scripts)]
        for name, _ in self.scripts:
            _run_script(self.folder / name)
        text = json.dumps(self.data).replace(_PLACE, str(self.folder))
        base = Document(json.loads(text), {}, self.config)
        base.recorded_robot = self.record
        return base


def _run_script(script: Path) -> None:
    """Run a Python file as `import_file` does, up to its own sweep if it has one."""
    global reading
    known = sys.modules.get(script.stem)
    if known is not None and _PREFIX not in (known.__file__ or ""):
        return  # this process started the sweep, and has the types
    sys.modules.pop(script.stem, None)  # the module of an earlier sweep
    reading = True
    try:
        import_file(script)
    except SweepReachedError:
        pass
    finally:
        reading = False


def _record(robot: Robot) -> dict[str, Any] | None:
    """Return the robot as recorded in a log, unless its files are in a package."""
    installed = {"bundled", "example-robot-data"}
    if all(part.source.origin in installed for part in robot.parts):
        return None
    record = robot_record(robot)
    if lost := record.get("missing"):
        _log.warning("%s has to be on all computers: %s", robot.name, lost)
        return None
    if any(part.get("left_out") for part in record.get("parts", ())):
        return None  # with a warning; each computer needs the files
    return record


def _declaring(named: set[str], imported: Sequence[str]) -> Iterator[Path]:
    """Yield the files of the types that the data name, and that no package provides.

    Other types come from an installed package, or from a module that a worker imports.
    """
    packages = {each.partition(".")[0] for each in imported}
    for part in _subclasses(Part):
        family, name = part.family, part.yaml_type
        if name not in named or family is None or family.members.get(name) is not part:
            continue
        module = part.__module__
        if module.startswith("hsp_control.") or name in entry_points(family.name):
            continue
        if module.partition(".")[0] in packages:
            continue
        file = getattr(sys.modules.get(module), "__file__", None)
        if file is None:
            raise SweepError(
                f"{part.__name__} is not declared in a file, so that workers cannot "
                "import it; move it into a file, and import that"
            )
        yield Path(file).resolve()


def _subclasses(part: type[Part]) -> Iterator[type[Part]]:
    for each in part.__subclasses__():
        yield each
        yield from _subclasses(each)


def _listed(factor: Any) -> Sequence[Any]:
    values = factor.values
    return values if isinstance(values, tuple) else ()


def _strings(value: Any) -> Iterator[str]:
    """Yield all texts in plain data that may be a type."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from _strings(list(value.values()))
    elif isinstance(value, list | tuple):
        for each in value:
            yield from _strings(each)
