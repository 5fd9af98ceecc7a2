"""Runs a page of the documents as a reader would: all blocks, in one empty folder.

Python is executed in one namespace, commands in a shell; a YAML block is loaded and run
briefly; a block after a line such as "Save it as `mine.yaml`:" becomes that file.
Exceptions are marked by an invisible comment before the block:

    <!-- not run: needs an arm -->         it is skipped, with this reason
    <!-- slow: a minute -->                only `make test-system` runs it
    <!-- Ctrl-C: serves a page -->         it runs until its first output
    <!-- part of: {robot: {name: panda}} -->    YAML that is a part of a configuration
    <!-- part of: forces/talos_wall KEY=VALUE -->    such YAML, in a bundled one
    <!-- lines of: engine/... -->          text that is in a file of the checkout
    <!-- background: a robot -->           it runs until the page ends
    <!-- fails: unstable gains -->         its status is 2, as in the page
    <!-- given: arm.urdf: robots/planar3r/planar3r.urdf -->    the reader's own file
"""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack, chdir, contextmanager, suppress
from fcntl import LOCK_EX, flock
from gc import collect
from importlib import import_module
from pathlib import Path
from tempfile import gettempdir
from time import monotonic, sleep
from typing import Any, NamedTuple, TextIO
from urllib.request import urlopen

import yaml
from places import ROOT, THOROUGH
from typing_commands import READY

from hsp_control import load_experiment
from hsp_control.common.resources import bundled_configs
from hsp_control.declaration import Part, imported

OUTPUT = {"text", "math", "bibtex"}
"""Languages of blocks that show output, or a formula."""
_FENCE = re.compile(r"^```([\w{].*?|)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_KINDS = "not run|slow|Ctrl-C|background|fails|part of|lines of"
_MARK = re.compile(rf"<!-- ({_KINDS}): ((?:(?!-->).)*) -->\s*$", re.DOTALL)
_GIVEN = re.compile(r"<!-- given: (\S+): (\S+) -->")
_FILE = re.compile(r"`([\w./-]+\.(\w+))`[^`]*:\s*$")
_ENDINGS = {"python": "py", "sh": "sh", "yaml": "yaml", "c": "c", "cpp": "cpp"}
_SYNTAX = {"json": json.loads, "toml": tomllib.loads}
_BRIEFLY = "--duration 1"
"""Default duration of `hsp live` [s]."""
_SHORT = "simulation.duration=0.02"


class Block(NamedTuple):
    """A block of a page.

    Attributes:
        language: The language of its fence.
        text: Its text.
        line: The line of the page at which its text begins.
        kind: The kind of the comment before it, if any.
        reason: The text of the comment.
        file: The name of the file that it becomes, if any.
    """

    language: str
    text: str
    line: int
    kind: str = ""
    reason: str = ""
    file: str = ""


def blocks_of(page: str) -> list[Block]:
    """Return the blocks of a page except the site's directives."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [_block(text, found) for found in _FENCE.finditer(text)
            if not found[1].startswith("{")]  # fmt: skip


def _block(text: str, found: re.Match[str]) -> Block:
    language, before = found[1], text[: found.start()]
    mark = _MARK.search(before)
    kind, reason = (mark[1], " ".join(mark[2].split())) if mark else ("", "")
    if mark:
        before = before[: mark.start()]
    named = _FILE.search(before.rstrip())
    own = named is not None and named[2] == _ENDINGS.get(language, named[2])
    line = text.count("\n", 0, found.start(2)) + 1
    file = named[1] if named is not None and own else ""
    return Block(language, found[2], line, kind, reason, file)


def runs_commands(page: str) -> bool:
    """Return whether a page has commands that can run."""
    return any(each.language == "sh" and each.kind != "not run"
               for each in blocks_of(page))  # fmt: skip


@contextmanager
def types_of_a_page() -> Iterator[None]:
    """Within the block types may be declared; they are removed at its end."""
    families = {each.family for each in _subclasses(Part) if each.family}
    members = {each: dict(each.members) for each in families}
    functions = dict(imported._functions)
    try:
        yield
    finally:
        for each, known in members.items():
            ours = {
                name: part
                for name, part in each.members.items()
                if part.__module__.startswith("hsp_control.")
            }  # a companion's
            each.members.clear()
            each.members.update(known | ours)
        imported._functions.clear()
        imported._functions.update(functions)


def _subclasses(part: type[Part]) -> Iterator[type[Part]]:
    for each in part.__subclasses__():
        yield each
        yield from _subclasses(each)


def run_page(page: str, folder: Path, *, whole: bool) -> dict[str, Any]:
    """Run a page in a folder, and return the variables of its Python.

    Args:
        page: Its path in the checkout.
        folder: An empty folder.
        whole: Also slow blocks, and commands.
    """
    text = (ROOT / page).read_text(encoding="utf-8")
    for name, source in _GIVEN.findall(text):
        _give(folder / name, source)
    space: dict[str, Any] = {"__name__": "__main__"}
    with ExitStack() as stack:
        stack.enter_context(chdir(folder))
        stack.enter_context(types_of_a_page())
        shell = stack.enter_context(Shell(folder))
        for block in blocks_of(page):
            if block.kind == "not run" or (block.kind == "slow" and not whole):
                continue
            where = f"{page}:{block.line}"
            if block.kind == "lines of":
                _check_lines(block, where)
            elif block.file:
                path = folder / block.file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text, encoding="utf-8")
                if block.language in _SYNTAX:
                    _SYNTAX[block.language](block.text)
                if block.language == "yaml":
                    _check_yaml(block, where)
            elif block.language == "python":
                code = "\n" * (block.line - 1) + block.text
                exec(compile(code, str(ROOT / page), "exec"), space)
            elif block.language == "yaml":
                _check_yaml(block, where)
            elif block.language == "sh":
                if whole:
                    shell.run(block, where)
            elif block.language not in OUTPUT:
                raise AssertionError(
                    f"{where}: a block of {block.language!r} is no file, and no "
                    "comment gives the reason why it does not run"
                )
    return space


def _give(path: Path, source: str) -> None:
    """Copy a file of the checkout, or write a text from a module of the tests."""
    path.parent.mkdir(exist_ok=True)
    if ":" in source:
        module, name = source.split(":")
        path.write_text(getattr(import_module(module), name), encoding="utf-8")
    else:
        shutil.copy(ROOT / source, path)


def _check_lines(block: Block, where: str) -> None:
    """Check that every line of C++ is in the file that the comment names."""
    there = set(_without_comments((ROOT / block.reason).read_text(encoding="utf-8")))
    missing = [line for line in _without_comments(block.text) if line not in there]
    assert not missing, f"{where}: not in {block.reason}: {missing}"


def _without_comments(text: str) -> list[str]:
    return [line.partition("//")[0].strip() for line in text.splitlines()]


def _base(reason: str) -> dict[str, Any]:
    """Return the rest of a configuration: its text, or a bundled one by name."""
    given = yaml.safe_load(reason)
    if isinstance(given, dict):
        return given
    return dict(yaml.safe_load(bundled_configs()[given].read_text(encoding="utf-8")))


def _laid_over(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration with the values of another, group by group."""
    both = {key: _laid_over(base[key], value)
            for key, value in over.items()
            if isinstance(value, dict) and isinstance(base.get(key), dict)}  # fmt: skip
    return base | over | both


def _check_yaml(block: Block, where: str) -> None:
    """Run a configuration briefly; a part is completed first."""
    data, overrides = yaml.safe_load(block.text), [_SHORT]
    if block.kind == "part of":
        base, *more = [block.reason] if block.reason[0] == "{" else block.reason.split()
        data, overrides = _laid_over(_base(base), data), [*more, _SHORT]
    try:
        status = load_experiment(data, *overrides).run().status
    except Exception as error:
        error.add_note(where)
        raise
    assert status == "completed", where
    collect()  # ports of its streams are free again


# --- commands -------------------------------------------------------------------------


class Shell:
    """A folder in which commands are run; background commands end with it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._background: list[Running] = []
        self._alone: TextIO | None = None
        hidden = {"DISPLAY", "WAYLAND_DISPLAY", "BROWSER", "HSP_ENGINE"}
        self._environment = {
            **{key: value for key, value in os.environ.items() if key not in hidden},
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "COLUMNS": "160",
            "PYTHONUNBUFFERED": "1",
        }

    def __enter__(self) -> "Shell":
        return self

    def __exit__(self, *_: object) -> None:
        for running in reversed(self._background):
            running.end()
        if self._alone is not None:
            self._alone.close()

    def run(self, block: Block, where: str) -> None:
        """Run the lines of a block; a failure is an error.

        A line that ends in ``&`` runs until the page ends.
        """
        if self._alone is None:  # pages use fixed ports: one at a time on this computer
            self._alone = (Path(gettempdir()) / "hsp-pages.lock").open("w")
            flock(self._alone, LOCK_EX)
        for line in lines_of(block.text):
            for name in ("examples", "benchmarks"):  # the page names their places
                if re.search(rf"\b{name}/", line) and not Path(name).exists():
                    Path(name).symlink_to(ROOT / name)
            if re.match(r"hsp live\b", line):  # the computer may be busy
                line += "" if "--robot" in line else " --lockstep"
                line += "" if "--duration" in line else f" {_BRIEFLY}"
            if re.match(r"hsp franka-box .*--lockstep", line):
                line = line.replace("--lockstep", "--lockstep --patience 60")
            if line.endswith("&") or block.kind == "background":
                self._background.append(self._start(line.rstrip("& "), where))
            elif block.kind == "Ctrl-C":
                if THOROUGH or not _of_the_readme(line) or where.startswith("README"):
                    self._interrupted(line, where, serves="page" in block.reason)
            elif re.fullmatch(r"hsp [\w ./=*-]+", line) and not block.kind:
                status, output = READY.run(
                    self._words(line)[1:], self._folder, self._environment
                )
                assert status == 0, f"{where}: {line}\n{output}"
            else:
                done = subprocess.run(
                    ["bash", "-ec", line], cwd=self._folder, env=self._environment,
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT, text=True, timeout=250, check=False,
                )  # fmt: skip
                status = 2 if block.kind == "fails" else 0
                assert done.returncode == status, f"{where}: {line}\n{done.stdout}"

    def _words(self, line: str) -> list[str]:
        """Return the words of a command, with patterns replaced by their files."""
        return [
            file
            for word in line.split()
            for file in (
                sorted(
                    str(each.relative_to(self._folder))
                    for each in self._folder.glob(word)
                )
                if "*" in word
                else [word]
            )
        ]

    def _start(self, line: str, where: str) -> "Running":
        """Start a command, and wait for its first output."""
        output = self._folder / f".output-{len(self._background)}"
        with output.open("w") as file:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {line}"], cwd=self._folder,
                env=self._environment, stdin=subprocess.DEVNULL, stdout=file,
                stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        running = Running(process, output, f"{where}: {line}")
        if not line.startswith("python"):  # a user's script may print nothing
            running.wait_for(r".")
        return running

    def _interrupted(self, line: str, where: str, *, serves: bool) -> None:
        """Start a command, request its page if it serves one, and press Ctrl-C."""
        running = self._start(line, where)
        if serves:
            served = running.wait_for(r"http://\S+", 200.0)
            assert served, f"{where}: {line}: no page\n{running.output.read_text()}"
            with urlopen(served[0], timeout=20) as answer:
                assert answer.status == 200
        status = running.end()
        assert status in {0, 130}, f"{running.about}\n{running.output.read_text()}"


def _of_the_readme(line: str) -> bool:
    """Return whether the README has this command as well, where it is run."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    return line.split("#")[0].strip() in {each.split("#")[0].strip() for each in lines}


class Running(NamedTuple):
    """A command that keeps running."""

    process: subprocess.Popen[bytes]
    output: Path
    about: str

    def wait_for(self, pattern: str, seconds: float = 60.0) -> re.Match[str] | None:
        """Return its output, or None if there is none in that time."""
        end = monotonic() + seconds
        while monotonic() < end:
            ended = self.process.poll() is not None
            if found := re.search(pattern, self.output.read_text()):
                return found
            if ended:
                return None
            sleep(0.05)
        return None

    def end(self) -> int:
        """Press Ctrl-C, and return the exit status; one that ignores it is killed."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGINT)
        try:
            return self.process.wait(60.0)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            return self.process.wait()


def lines_of(text: str) -> list[str]:
    """Return the commands of a shell block, without comments."""
    found, pending = [], ""
    for line in text.replace("\\\n", " ").splitlines():
        pending = f"{pending}\n{line}" if pending else line
        with suppress(ValueError):  # a quotation goes on in the next line
            shlex.split(pending, comments=True)
            command = pending.partition(" #")[0].strip()
            if command and not command.startswith("#"):
                found.append(command)
            pending = ""
    return found
