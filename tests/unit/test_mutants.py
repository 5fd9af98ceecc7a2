"""The mutants fit the code, and their runner says truly what became of each."""

from pathlib import Path

import mutants
import pytest
from mutants import MUTANTS, Mutant
from places import ROOT

HERE = [  # without those of companions that were taken away
    each
    for each in MUTANTS
    if all(
        "companions/" not in file or (ROOT / file).parent.is_dir()
        for file in (each.file, each.tests)
    )
]
every_mutant = pytest.mark.parametrize("mutant", HERE, ids=lambda m: m.name)

# --- the list ------------------------------------------------------------------------


@every_mutant
def test_the_edit_fits_one_place_and_is_still_python(mutant: Mutant) -> None:
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    changed = mutants.mutated(mutant, text)
    assert changed != text
    if mutant.file.endswith(".py"):
        compile(changed, mutant.file, "exec")


@every_mutant
def test_the_tests_that_should_see_it_exist(mutant: Mutant) -> None:
    """Files that exist; with -k, a word of one test's or parameter's name in them."""
    files, _, word = mutant.tests.partition(" -k ")
    assert files
    assert all((ROOT / file).is_file() for file in files.split())
    assert " " not in word


# --- the runner ----------------------------------------------------------------------

CODE = "def area(a, b):\n    unused = a + b\n    return a * b\n"
TESTS = """from code_under_test import area


def test_area():
    assert area(2.0, 3.0) == 6.0
"""
CAUGHT, SURVIVING, BREAKING, ELSEWHERE = (
    Mutant(name, "code_under_test.py", old, new, tests)
    for name, old, new, tests in (
        ("half an area", "a * b", "0.5 * a * b", "test_area.py"),
        ("another sum", "a + b", "a - b", "test_area.py"),
        ("a test that is not there", "a * b", "a / b", "test_area.py -k volume"),
        ("code that is not there", "a ** b", "a * b", "test_area.py"),
    )
)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Return a folder with one function and one test."""
    (tmp_path / "code_under_test.py").write_text(CODE)
    (tmp_path / "test_area.py").write_text(TESTS)
    return tmp_path


@pytest.mark.process
def test_the_runner_tells_who_was_caught(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each is tried alone, and the code is afterwards what it was."""
    found = list(mutants.tried(checkout, [CAUGHT, SURVIVING, BREAKING]))
    assert found == [
        ("half an area", "caught"),
        ("another sum", "SURVIVED"),
        ("a test that is not there", "BROKEN"),
    ]
    first, second, third = capsys.readouterr().out.splitlines()
    assert first.split()[:2] == ["1/3", "caught"]
    assert first.endswith("FAILED test_area.py::test_area")
    assert "SURVIVED" in second
    assert "BROKEN" in third
    assert (checkout / "code_under_test.py").read_text() == CODE


@pytest.mark.process
def test_tests_that_fail_anyway_catch_nothing(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (checkout / "test_area.py").write_text(TESTS.replace("6.0", "7.0"))
    assert list(mutants.tried(checkout, [CAUGHT])) == [("half an area", "BROKEN")]
    assert "do not pass without the edit" in capsys.readouterr().out


@pytest.mark.process
@pytest.mark.parametrize(
    ("wrong", "detail"),
    [
        ("while True:\n        pass", "did not end"),
        ("bytes(1 << 40)", "FAILED test_area.py::test_area"),
    ],
)
def test_what_never_ends_or_eats_the_memory_is_caught(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, wrong: str, detail: str
) -> None:
    monkeypatch.setattr(mutants, "LONGEST", 5.0)
    (checkout / "code_under_test.py").write_text(f"def area(a, b):\n    {wrong}\n")
    assert mutants.run(checkout, "test_area.py") == ("caught", detail)
