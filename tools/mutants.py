"""Break the code on purpose, and see whether a test notices: ``make mutants``.

Every mutant is one edit in one named place, and the tests that should go red. A mutant
that survives is a claim that nobody checks. ``tests/unit/test_mutants.py`` checks that
every edit still fits the code.

    python tools/mutants.py                    all of them
    python tools/mutants.py law gain           those whose name contains a word
    python tools/mutants.py --list
"""

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COPIED = (
    *("hsp_control", "tests", "robots", "configs", "docs", "pyproject.toml"),
    *("engine", "hatch_build.py"),
)
TESTS_FAILED = 1
"""The exit status of pytest when tests ran and one failed."""
LONGEST, MEMORY = 900.0, 16 << 30
"""What the tests of one mutant may take: time [s], and memory that they ask for [B]."""


class Mutant(NamedTuple):
    """One edit that makes the code wrong and keeps it running.

    Attributes:
        name: What is wrong then.
        file: The edited file, from the checkout's folder.
        old: The text that is replaced; it stands in the file once.
        new: What replaces it.
        tests: Arguments of pytest: the tests that should go red.
    """

    name: str
    file: str
    old: str
    new: str
    tests: str


def read(text: str) -> tuple[Mutant, ...]:
    """Return the mutants of a text.

    A line ``@ file | tests`` says where what follows is and who should see it: the name
    of each mutant, with the word for pytest's -k if any, and its edit: ``old => new``,
    indented, or as in a diff.
    """
    found: list[tuple[str, str, dict[str, list[str]], str]] = []
    file = tests = ""
    for line in text.strip().splitlines():
        if line.startswith("@"):
            file, tests = line[2:].split(" | ")
        elif line.startswith(("-", "+")):
            found[-1][2][line[0]].append(line[1:])
        elif line.startswith("  "):
            old, new = line[2:].split(" => ")
            found[-1][2].update({"-": [old], "+": [new]})
        elif not line.startswith("#"):
            name, _, word = line.partition(" | ")
            chosen = f"tests/{tests} -k {word}" if word else f"tests/{tests}"
            path = file if file.startswith("engine/") else f"hsp_control/{file}"
            found.append((name, path, {"-": [], "+": []}, chosen))
    return tuple(
        Mutant(name, file, "\n".join(edit["-"]), "\n".join(edit["+"]), chosen)
        for name, file, edit, chosen in found
    )


MUTANTS = read((Path(__file__).parent / "mutants.txt").read_text(encoding="utf-8"))
"""All of them, from the lowest room to the highest."""


class Verdict(NamedTuple):
    """What became of one mutant.

    Attributes:
        word: ``caught``, ``SURVIVED`` or ``BROKEN`` (no test ran).
        detail: The first test that failed, or the end of what was printed.
    """

    word: str
    detail: str


def main(arguments: Sequence[str] | None = None) -> int:
    """Try mutants; return 0 if all were caught."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("words", nargs="*", help="parts of names; default: all")
    parser.add_argument("--list", action="store_true", help="print the names")
    options = parser.parse_args(arguments)
    chosen = [
        mutant
        for mutant in MUTANTS
        if not options.words or any(word in mutant.name for word in options.words)
    ]
    if options.list:
        print(*(mutant.name for mutant in chosen), sep="\n")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        copy.mkdir()
        for name in COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, copy / name)
            else:
                shutil.copy(source, copy / name)
        not_caught = [name for name, word in tried(copy, chosen) if word != "caught"]
    print(f"{len(chosen) - len(not_caught)} of {len(chosen)} caught")
    if not_caught:
        print("not caught:", *not_caught, sep="\n  ")
    return 1 if not_caught else 0


def tried(copy: Path, mutants: Sequence[Mutant]) -> Iterator[tuple[str, str]]:
    """Try each mutant in a copy of the checkout; yield its name and the verdict."""
    sound: dict[str, Verdict] = {}
    for number, mutant in enumerate(mutants, start=1):
        if mutant.tests not in sound:
            sound[mutant.tests] = run(copy, mutant.tests)
        file = copy / mutant.file
        text = file.read_text(encoding="utf-8")
        file.write_text(mutated(mutant, text), encoding="utf-8")
        start = perf_counter()
        compiles = rebuilt(copy, mutant)
        verdict = run(copy, mutant.tests)
        file.write_text(text, encoding="utf-8")
        rebuilt(copy, mutant)
        if not compiles:
            verdict = Verdict("BROKEN", "it does not compile")
        if sound[mutant.tests].word != "SURVIVED":
            verdict = Verdict("BROKEN", "its tests do not pass without the edit")
        print(
            f"{number:3d}/{len(mutants)} {verdict.word:9} {mutant.name:44} "
            f"{perf_counter() - start:4.0f} s  {verdict.detail}",
            flush=True,
        )
        yield mutant.name, verdict.word


def rebuilt(copy: Path, mutant: Mutant) -> bool:
    """Build the engine anew if the mutant is in it; return whether it compiles."""
    if not mutant.file.startswith("engine/"):
        return True
    made = subprocess.run(
        [sys.executable, "hatch_build.py"], cwd=copy, capture_output=True, check=False
    )
    return made.returncode == 0


def mutated(mutant: Mutant, text: str) -> str:
    """Return the text with the mutant's edit.

    Raises:
        ValueError: If the edit does not fit just one place.
    """
    count = text.count(mutant.old)
    if count != 1:
        raise ValueError(f"{mutant.name}: {count} places in {mutant.file} fit; needs 1")
    return text.replace(mutant.old, mutant.new)


def run(copy: Path, tests: str) -> Verdict:
    """Run tests in a copy of the checkout until one fails, or all are too long."""
    started = subprocess.Popen(
        [
            *(sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:randomly"),
            *("-p", "no:cacheprovider", "--tb=no", *tests.split()),
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
        os.killpg(started.pid, signal.SIGKILL)  # and what it has started
        started.communicate()
        return Verdict("caught", "did not end")
    if started.returncode < 0:
        return Verdict("caught", f"died of signal {-started.returncode}")
    if started.returncode == TESTS_FAILED:
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        return Verdict("caught", failed[0].split(" - ")[0] if failed else "")
    word = "SURVIVED" if started.returncode == 0 else "BROKEN"
    return Verdict(word, lines[-1] if lines else "")


if __name__ == "__main__":
    sys.exit(main())
