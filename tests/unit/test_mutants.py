"""Mutants of any code, and the outcomes that their runner reports."""

from pathlib import Path

import mutants
import pytest
from mutants import Mutant, Verdict
from mutations import Edit, edits
from places import ROOT, further

PYTHON = '''def limited(x: float = 0.5, low: float = -1.0) -> float:
    """Not 1 < 2."""
    if x < low or not x:
        raise ValueError(f"{x + 1} is too low")
    check(x)
    return (x * 2.0) if x is low else x
'''
CPP = """// a + b
double limited(double x) {
  const double low = std::min(x, 0.5);  // x < 1.0
  if (x < low && here(x)) out[0] = x + low;
  y.row(1) = "a + b";
}
"""
OF_PYTHON = {
    "0.5 => 1.0", "-1.0 => (1.0)", "1.0 => 2.0", "not x => (x)",
    "x < low => (x <= low)",
    "x < low or not x => (x < low and (not x))", "check(x) => pass", "2.0 => 4.0",
    "x * 2.0 => (x / 2.0)", "x is low => (x is not low)",
    "(x * 2.0) if x is low else x => (x * 2.0 if not x is low else x)",
}  # fmt: skip
OF_CPP = {
    "std::min( => std::max(", "0.5 => 1.0", "< => <=", "&& => ||", "+ => -",
    "if (x < low && here(x)) => if (!(x < low && here(x)))",
    'y.row(1) = "a + b"; => ;',
}  # fmt: skip


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [("a.py", PYTHON, OF_PYTHON), ("a.hpp", CPP, OF_CPP)],
    ids=["Python", "C++"],
)
def test_edits_change_code_and_no_text(
    file: str, text: str, expected: set[str]
) -> None:
    found = list(edits(file, text))
    assert {str(edit) for edit in found} == expected
    for edit in found:
        changed = edit.applied(text).splitlines()
        assert text.splitlines()[edit.line - 1] != changed[edit.line - 1]


@pytest.mark.parametrize(
    "file", ["hsp_control/control/mixture.py", "engine/law/law.hpp"]
)
def test_files_of_the_house_have_edits_and_python_compiles_with_each(file: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    found = list(edits(file, text))
    assert len(found) > 20
    if file.endswith(".py"):
        for edit in found:
            compile(edit.applied(text), file, "exec")


def test_an_edit_is_of_the_text_that_it_was_made_for() -> None:
    (edit,) = edits("a.py", "a + b\n")
    with pytest.raises(ValueError, match=r"line 1 is not 'a \+ b'"):
        edit.applied("a - b\n")


@pytest.mark.parametrize(
    ("file", "first"),
    [
        ("hsp_control/control/mixture.py", "tests/unit/control"),
        ("engine/fields/barrier.hpp", "tests/unit/null_space"),
        (
            "hsp_control/companions/walking/walk.py",
            "hsp_control/companions/walking/tests",
        ),
        ("hsp_control/__init__.py", "tests/unit"),
    ],
)
def test_the_tests_of_the_same_folder_run_first(file: str, first: str) -> None:
    if (ROOT / first).is_dir():  # companions may have been removed
        assert mutants.tests_of(file)[0] == first


def test_the_same_seed_draws_the_same_mutants() -> None:
    files = ["hsp_control/control/mixture.py", "engine/law/law.hpp"]
    once, again, other = (mutants.drawn(files, 5, seed) for seed in (1, 1, 2))
    assert once == again
    assert once != other


# --- the runner ----------------------------------------------------------------------

CODE = "def area(a, b):\n    unused = a + b\n    return a * b\n"
TESTS = """from code_under_test import area


def test_area():
    assert area(2.0, 3.0) == 6.0
"""


def mutant(old: str, new: str, tests: str) -> Mutant:
    """Return an edit of that code."""
    edit = Edit(1, CODE.index(old), old, new)
    return Mutant("code_under_test.py", edit, tuple(tests.split()))


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with one function and one test, also listed as the fast one."""
    (tmp_path / "code_under_test.py").write_text(CODE)
    (tmp_path / "test_area.py").write_text(TESTS)
    monkeypatch.setattr(mutants, "FAST", ("test_area.py",))
    return tmp_path


@pytest.mark.process
@pytest.mark.parametrize("number", further(3))  # `make thorough` runs it, too
def test_the_runner_reports_caught_mutants(
    number: int, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Mutants are tried one at a time; the code is restored afterwards."""
    tests = "test_area.py"
    tried = [
        mutant("a * b", "0.5 * a * b", tests),
        mutant("a + b", "a - b", tests),
        mutant("a * b", "a / b", "test_area.py -k volume"),
    ]
    assert len(tried) == number
    found = [verdict.word for _, verdict in mutants.tried(checkout, tried)]
    assert found == ["caught", "SURVIVED", "void"]
    first, second, third = capsys.readouterr().out.splitlines()
    assert first.split()[:2] == ["1/3", "caught"]
    assert first.endswith("FAILED test_area.py::test_area")
    assert "SURVIVED" in second
    assert "void" in third
    assert (checkout / "code_under_test.py").read_text() == CODE


@pytest.mark.process
def test_tests_that_fail_anyway_catch_nothing(checkout: Path) -> None:
    (checkout / "test_area.py").write_text(TESTS.replace("6.0", "7.0"))
    edit = mutant("a * b", "0.5 * a * b", "test_area.py")
    ((_, verdict),) = mutants.tried(checkout, [edit])
    assert verdict == ("void", "FAILED test_area.py::test_area without the edit, too")


@pytest.mark.process
def test_fast_tests_that_fail_anyway_catch_nothing_either(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the room's tests do not see would be caught by any error of the others."""
    (checkout / "test_other.py").write_text("import not_copied\n")
    monkeypatch.setattr(mutants, "FAST", ("test_other.py",))
    edit = mutant("a + b", "a - b", "test_area.py")
    ((_, verdict),) = mutants.tried(checkout, [edit])
    assert verdict.word == "void"
    assert "without the edit, too" in verdict.detail


@pytest.mark.process
@pytest.mark.parametrize(
    ("wrong", "detail"),
    [
        ("while True:\n        pass", "did not end"),
        *further(("bytes(1 << 40)", "FAILED test_area.py::test_area")),
    ],
)
def test_endless_or_memory_hungry_mutants_are_caught(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, wrong: str, detail: str
) -> None:
    monkeypatch.setattr(mutants, "LONGEST", 5.0)
    (checkout / "code_under_test.py").write_text(f"def area(a, b):\n    {wrong}\n")
    assert mutants.run(checkout, ["test_area.py"]) == Verdict("caught", detail)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout: a copy")
def test_tests_and_benchmarks_of_companions_are_not_broken() -> None:
    files = mutants.sources("hsp_control/companions", None)
    assert "hsp_control/companions/viewer/page_plots.py" in files
    assert not [file for file in files if "/tests/" in file or "/benchmark/" in file]
