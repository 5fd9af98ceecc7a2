"""A configuration as plain data, from any source, with the keys' lines."""

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.errors import ConfigError, HspControlError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.resources import bundled_configs, is_file
from hsp_control.common.suggestions import did_you_mean, listing, nearest
from hsp_control.config.recorded_scene import with_recorded_scene
from hsp_control.config.streams import with_recordings
from hsp_control.config.yaml_reader import (
    MAX_DEPTH,
    MAX_SIZE,
    Mark,
    YamlError,
    read_yaml,
)
from hsp_control.declaration.families import only_packages
from hsp_control.declaration.language import in_yaml, shortened, shown, spoken
from hsp_control.declaration.located import (
    KeyPath,
    locate,
    located,
    split_assignment,
    written,
)
from hsp_control.robot.description.access import ANYWHERE, only_within
from hsp_control.robot.description.sources import is_robot, packaged_folders
from hsp_control.robot.recorded import usable_record
from hsp_control.simulation import Rollout


def assign(data: dict[str, Any], keys: list[str], value: Any) -> KeyPath:
    """Set the value at a key path, and create missing keys; the schema checks them."""
    if len(keys) > MAX_DEPTH:
        raise ValueError(f"nested deeper than {MAX_DEPTH} levels")
    holder: Any = data
    path: KeyPath = ()
    for key in keys[:-1]:
        place = _place(holder, key, path)
        inner = holder.get(place) if isinstance(holder, dict) else holder[place]
        if inner is None:
            inner = holder[place] = {}
        holder = inner
        path = (*path, place)
    last = _place(holder, keys[-1], path)
    holder[last] = value
    return (*path, last)


def _place(holder: Any, key: str, path: KeyPath) -> str | int:
    """Return ``key`` for a mapping, or the index of the entry for a list."""
    if isinstance(holder, dict):
        return key
    if not isinstance(holder, list):
        raise ValueError(f"{written(path)} is {shown(holder)}, which has no keys")
    if not re.fullmatch(r"[0-9]{1,6}", key) or int(key) >= len(holder):
        entries = f"0 to {len(holder) - 1}" if holder else "none"
        raise ValueError(f"{written(path)} has no entry {key!r} (entries: {entries})")
    return int(key)


_TOO_LARGE = f"larger than {MAX_SIZE // 1_000_000} MB, the limit for a configuration"
_LONGEST_ORIGIN = 72


class Document:
    """The plain data of a YAML text, with a location for every key path.

    A key path is a tuple: ``("tasks", 0, "frame")`` for ``tasks.0.frame``. All errors
    have the form ``file:line: key.path: the error``.
    """

    def __init__(
        self, data: dict[str, Any], marks: dict[KeyPath, Mark], name: str
    ) -> None:
        self.name = name  # the file's path as it was given, for messages
        self.access = ANYWHERE  # which files the configuration may name
        # the packages whose types it may name, besides our own; None: all
        self.packages: frozenset[str] | None = None
        # a log's record of its robot, unless another one is chosen; see `recorded`
        self.recorded_robot: Any = None
        # of a log: SHA-256 of its imported code, by name
        self.recorded_code: dict[str, str] | None = None
        self.imports_recorded_code = False  # also where files are read strictly
        self.given_code: frozenset[str] = frozenset()  # code that the user named, too
        self._data = deepcopy(data)
        self._origins: dict[KeyPath, Mark | str] = dict(marks)
        self._written = bool(marks)  # read from a text, not built in Python

    @classmethod
    def read(cls, path: str | PathLike[str]) -> "Document":
        """Read a YAML file."""
        name = fspath(path)
        try:
            check_ends(Path(name))
            with Path(name).open("rb") as file:
                content = file.read(MAX_SIZE + 1)
        except (OSError, ValueError) as error:
            raise located(name, _why_unreadable(name, error)) from None
        if len(content) > MAX_SIZE:
            raise located(name, _TOO_LARGE)
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            message = f"not UTF-8 text (byte 0x{content[error.start]:02x})"
            raise located(f"{name}:{line}", message) from None
        return cls.parse(text, name)

    @classmethod
    def parse(cls, text: str, name: str = "<string>") -> "Document":
        """Parse a YAML text."""
        if len(text) > MAX_SIZE:
            raise located(name, _TOO_LARGE)
        try:
            data, marks = read_yaml(text)
        except YamlError as error:
            where = f"{name}:{error.line}"
            raise located(where, error.message, error.path) from None
        if not isinstance(data, dict):
            what = "is empty" if data is None else f"is {shown(data)}"
            message = f"{what}; a configuration must be a mapping (key: value)"
            raise located(f"{name}:{marks[()].line}", message)
        return cls(data, marks, name)

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read the data: messages use their language, other packages are refused."""
        with ExitStack() as stack:
            if self._written:
                stack.enter_context(in_yaml())
            if self.packages is not None:
                stack.enter_context(only_packages(*self.packages))
            yield

    def to_dict(self) -> dict[str, Any]:
        """Return a copy of the data."""
        return deepcopy(self._data)

    def override(self, assignment: str) -> None:
        """Change one value by ``tasks.0.gains.kp=100``, the argument of ``--set``.

        The value is YAML. Keys with a dot need quotes: ``frames.'a.b'.parent=x``.
        """
        if not isinstance(assignment, str):
            raise ConfigError(
                f"{shown(assignment)} is not text such as 'key.path=value'"
            )
        words = " ".join(assignment.split())
        origin = shortened(spoken(f"--set {words}", repr(words)), _LONGEST_ORIGIN)
        try:
            keys, text = split_assignment(assignment)
            value, _ = read_yaml(text)
        except YamlError as error:
            raise located(origin, error.message) from None
        except ValueError as error:
            raise located(origin, str(error)) from None
        self.assign(keys, value, origin)

    def assign(self, keys: list[str], value: Any, origin: str) -> KeyPath:
        """Set the value at a key path; ``origin`` is its place in messages."""
        try:
            path = assign(self._data, keys, value)
        except ValueError as error:
            raise located(origin, str(error)) from None
        if path[0] == "robot":
            self.recorded_robot = None
        for inside in [key for key in self._origins if key[: len(path)] == path]:
            del self._origins[inside]
        for end in range(1, len(path)):  # containers created on the way
            if self._written:
                self._origins.setdefault(path[:end], origin)
        self._origins[path] = origin
        return path

    def __contains__(self, path: KeyPath) -> bool:
        value: Any = self._data
        for part in path:
            if isinstance(value, list):
                value = dict(enumerate(value))
            if not isinstance(value, dict) or part not in value:
                return False
            value = value[part]
        return True

    def says_nothing(self, key: str) -> bool:
        """Return whether the text has the key without a value."""
        given = self._data.get(key, self) is None
        return given and isinstance(self._origins.get((key,)), Mark)

    def mark(self, path: KeyPath) -> Mark | None:
        """Return the place of a key path in the text, None if it was overridden."""
        origin = self._origin(path)
        return origin if isinstance(origin, Mark) else None

    def location(self, path: KeyPath) -> str:
        """Return ``file.yaml:12``, or ``--set key=value`` if it was overridden."""
        origin = self._origin(path)
        return f"{self.name}:{origin.line}" if isinstance(origin, Mark) else origin

    def error(self, path: KeyPath, message: str) -> ConfigError:
        """Return an error about the value at the key path, for the caller to raise."""
        return located(self.location(path), message, path)

    @contextmanager
    def at(self, *path: str | int) -> Iterator[None]:
        """Add the location of a key path to errors that are raised inside the block.

        An error with a location keeps it: that of the innermost block. A
        key path that the error has itself continues the given one::

            with document.at("tasks", "hand"), within("frame"):
                robot.frame_id("panda_hnad")  # FrameNotFoundError: panda.yaml:7: ...
        """
        try:
            yield
        except HspControlError as error:
            whole = (*path, *error.path)
            locate(error, self.location(whole), whole)
            raise

    def _origin(self, path: KeyPath) -> Mark | str:
        while path and path not in self._origins:
            path = path[:-1]
        return self._origins.get(path, self.name)  # data without a file


def _why_unreadable(name: str, error: OSError | ValueError) -> str:
    if isinstance(error, IsADirectoryError):
        return "is a folder; give a file"
    if isinstance(error, FileNotFoundError):
        files = {file.stem: file.name for file in Path(name).parent.glob("*.yaml")}
        near = nearest(Path(name).stem, files)
        hint = f"; did you mean {files[near]!r}?" if near else ""
        return f"no such file{hint}"
    return f"cannot be read: {getattr(error, 'strerror', None) or error}"


# --- sources --------------------------------------------------------------


def read_document(
    source: str | PathLike[str] | dict[str, Any],
    *,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Document:
    """Return the configuration's data with the locations of keys."""
    document = _read(source, strict)
    if strict:
        own = [] if isinstance(source, dict) else [Path(document.name).parent]
        document.access = only_within([*own, *packaged_folders(), *allow])
        document.packages = frozenset(map(str, allow))
    return document


def _read(source: str | PathLike[str] | dict[str, Any], strict: bool) -> Document:
    if isinstance(source, dict):
        return Document(source, {}, "configuration")
    if not isinstance(source, str | PathLike):
        raise ConfigError(f"{shown(source)} is neither a name, a path nor a dict")
    path = Path(source)
    if path.suffix in {".npz", ".journal"}:
        run = Rollout.load(path)
        if not strict:  # an untrusted log writes no files
            run = with_recorded_scene(run)
        if run.config is None:
            raise ConfigError(
                f"{path}: this log was made from Python and contains no configuration"
                + (f": {lost}" if (lost := run.meta.get("config_lost")) else "")
            )
        if lost := run.meta.get("changes_lost"):
            raise ConfigError(
                f"{path}: the run cannot be repeated, because some changes during it "
                f"cannot be written as data: {lost}"
            )
        if lost := run.meta.get("streams_lost"):
            raise ConfigError(
                f"{path}: the run cannot be repeated, because {lost} messages of its "
                "streams were not recorded: there were too many"
            )
        _check_heard(path, run)
        made = run.meta.get("changes") or []
        config = with_recordings(
            run.config,
            run.meta.get("streams") or {},
            run.meta.get("plan_streams") or [],
        )
        document = Document(config | {"changes": made}, {}, str(path))
        document.recorded_robot = usable_record(run.meta)
        document.recorded_code = run.meta.get("imported") or {}
        return document
    known = bundled_configs()
    if path.suffix in {".yaml", ".yml"} or is_file(path):
        return Document.read(path)
    if str(source) in known:
        return Document.read(known[str(source)])
    if is_robot(str(source)):
        raise ConfigError(
            f"{str(source)!r} is a robot, and this needs a configuration; "
            + spoken(f"hsp play {source} drives", f"Robot.load({source!r}) loads")
            + " the robot"
        )
    raise ConfigError(
        f"no configuration {str(source)!r}{did_you_mean(str(source), known)} "
        f"(give the path of a .yaml file, or one of: {listing(known)})"
    )


def _check_heard(path: Path, run: Rollout) -> None:
    """Check that a log contains all messages that its streams used."""
    for name, recordings in (run.meta.get("streams") or {}).items():
        for k, messages in enumerate(recordings):
            column = f"stream.{name}{f'_{k + 1}' if k else ''}.taken"
            taken = np.nanmax(run[column]) if column in run.columns else 0
            if taken > len(messages):
                raise ConfigError(
                    f"{path}: the run cannot be repeated: a stream of task {name!r} "
                    f"used {taken:.0f} messages, and the log contains {len(messages)} "
                    "of them, because its writer was killed"
                )
