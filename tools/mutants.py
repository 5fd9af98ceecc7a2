"""Break the code on purpose, and see whether a test notices: ``make mutants``.

A mutant is one edit: of an operator, a number, a condition or a statement, drawn at
random (`mutations.py`). The tests of its folder run first, then the fast ones of all
folders. A mutant that survives shows a claim without a test, or an edit without an
effect, such as of a bound that is never reached.

    python tools/mutants.py                          twenty, half of them in the engine
    python tools/mutants.py engine/law hsp_control/control --count 50
    python tools/mutants.py --since main             in the changes since
    python tools/mutants.py --seed 7                 the same again
"""

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from mutations import Edit, edits

ROOT = Path(__file__).resolve().parents[1]
CODE = ("hsp_control", "engine")
LEFT_OUT = (".git", ".venv*", "build", "out", "dist", "_build", "__pycache__")
"""Files and folders of the checkout that no test needs, in every folder."""
TESTS_FAILED = 1
"""The exit status of pytest when tests ran and one failed."""
LONGEST, MEMORY = 900.0, 16 << 30
"""Limits of the tests of one mutant: time [s], and allocated memory [B]."""
FAST = ("tests/unit", "-m", "not slow and not process and not browser")
"""Tests that run when those of a room detect nothing: those of `make quick`."""
ROOMS = {
    "dynamics": ("robot", "tasks"),
    "compensation": ("simulation", "control"),
    "contacts": ("constraints", "control"),
    "fields": ("null_space",),
    "integrators": ("robot", "simulation"),
    "limits": ("control", "constraints"),
    "linalg": ("engine", "law"),
    "metrics": ("null_space",),
    "qp": ("control",),
    "src": ("engine",),
    "include": ("frozen", "engine"),
}
"""The tests of a room of the engine that has no tests of that name."""


class Mutant(NamedTuple):
    """An edit of a file that most likely makes the code wrong.

    Attributes:
        file: The file, from the checkout's folder.
        edit: The replacement.
        tests: Arguments of pytest: the tests of its room.
    """

    file: str
    edit: Edit
    tests: tuple[str, ...]

    def __str__(self) -> str:
        """Return its place and its effect."""
        return f"{self.file}:{self.edit.line}  {self.edit}"


class Verdict(NamedTuple):
    """The outcome of a mutant.

    Attributes:
        word: ``caught``, ``SURVIVED``, ``void``: it does not compile, or no test ran.
        detail: The first test that failed, or the end of the output.
    """

    word: str
    detail: str


def tests_of(file: str) -> tuple[str, ...]:
    """Return the tests of a file's room; those of all rooms if it has none."""
    _, room, *rest = file.split("/")
    if room == "companions":
        named = [f"hsp_control/companions/{rest[0]}/tests"]
    else:
        named = [f"tests/unit/{each}" for each in ROOMS.get(room, (room,))]
    there = tuple(each for each in named if (ROOT / each).is_dir())
    return (*there, "-m", "not system") if there else FAST


def sources(place: str, since: str | None) -> list[str]:
    """Return the files to break: below a place, and changed since a commit if given.

    Tests and benchmarks of companions are no code of a user's.
    """
    command = ["git", "ls-files", place]
    if since:
        command = ["git", "diff", "--name-only", "--diff-filter=d", since, "--", place]
    listed = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    return [
        file
        for file in listed
        if file.startswith(CODE)
        and file.endswith((".py", ".hpp", ".cpp"))
        and not {"tests", "benchmark"} & {*file.split("/")}
    ]


def drawn(files: Iterable[str], count: int, seed: int) -> list[Mutant]:
    """Return so many random mutants of files; all edits of all are equally likely."""
    everything = [
        (file, edit)
        for file in files
        for edit in edits(file, (ROOT / file).read_text(encoding="utf-8"))
    ]
    chosen = random.Random(seed).sample(everything, min(count, len(everything)))
    return [Mutant(file, edit, tests_of(file)) for file, edit in sorted(chosen)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Try mutants and print the share that was caught; return 0 if any was tried."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("places", nargs="*", default=[*CODE], help="files and folders")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    parser.add_argument("--since", metavar="COMMIT", help="only files changed since it")
    parser.add_argument("--list", action="store_true", help="print them, try none")
    options = parser.parse_args(arguments)
    mutants = [
        mutant
        for place in options.places  # as many of each
        for mutant in drawn(
            sources(place, options.since),
            options.count // len(options.places),
            options.seed,
        )
    ]
    if options.list:
        print(*mutants, sep="\n")
        return 0
    print(f"{len(mutants)} mutants, --seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*LEFT_OUT))
        found = list(tried(copy, mutants))
    caught = sum(verdict.word == "caught" for _, verdict in found)
    tests = sum(verdict.word != "void" for _, verdict in found)
    share = 100.0 * caught / max(tests, 1)
    print(f"{caught} of {tests} caught, {share:.0f} % (--seed {options.seed})")
    for mutant, verdict in found:
        if verdict.word == "SURVIVED":
            print(f"  {mutant}")
    return 0 if tests else 1


def tried(copy: Path, mutants: Sequence[Mutant]) -> Iterator[tuple[Mutant, Verdict]]:
    """Try mutants in a copy of the checkout; yield them with their verdicts."""
    sound: dict[tuple[str, ...], Verdict] = {}
    for number, mutant in enumerate(mutants, start=1):
        start = perf_counter()
        for tests in (mutant.tests, FAST):
            if tests not in sound:
                sound[tests] = run(copy, tests)
        file = copy / mutant.file
        text = file.read_text(encoding="utf-8")
        file.write_text(mutant.edit.applied(text), encoding="utf-8")
        verdict = Verdict("void", "it does not compile")
        if rebuilt(copy, mutant):
            verdict = run(copy, mutant.tests)
            if verdict.word == "SURVIVED" and mutant.tests != FAST:
                verdict = run(copy, FAST)
        file.write_text(text, encoding="utf-8")
        for tests in (mutant.tests, FAST):
            if sound[tests].word != "SURVIVED":
                why = f"{sound[tests].detail} without the edit, too"
                verdict = Verdict("void", why)
        print(
            f"{number:3d}/{len(mutants)} {verdict.word:9} {mutant} "
            f"{perf_counter() - start:4.0f} s  {verdict.detail}",
            flush=True,
        )
        yield mutant, verdict


def rebuilt(copy: Path, mutant: Mutant) -> bool:
    """Build the engine anew if the mutant is in it; return whether it compiles.

    Code that the previous mutant broke is rebuilt, too.
    """
    if not mutant.file.startswith("engine/"):
        return True
    made = subprocess.run(
        [sys.executable, "hatch_build.py"], cwd=copy, capture_output=True, check=False
    )
    return made.returncode == 0


def run(copy: Path, tests: Sequence[str]) -> Verdict:
    """Run tests in a copy of the checkout until one fails, or all are too long."""
    started = subprocess.Popen(
        [
            *(sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:randomly"),
            *("-p", "no:cacheprovider", "--tb=no", *tests),
        ],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(copy)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )
    try:
        lines = started.communicate(timeout=LONGEST)[0].strip().splitlines()
    except subprocess.TimeoutExpired:
        os.killpg(started.pid, signal.SIGKILL)  # and its child processes
        started.communicate()
        return Verdict("caught", "did not end")
    if started.returncode < 0:
        return Verdict("caught", f"died of signal {-started.returncode}")
    if started.returncode == TESTS_FAILED:
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        return Verdict("caught", failed[0].split(" - ")[0] if failed else "")
    if started.returncode == 0:
        return Verdict("SURVIVED", lines[-1] if lines else "")
    # Status 2: the tests' imports fail.
    word = "caught" if started.returncode == 2 else "void"
    return Verdict(word, lines[-1] if lines else "")


if __name__ == "__main__":
    sys.exit(main())
