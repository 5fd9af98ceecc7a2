"""The package's public names, and the cost of importing it and starting `hsp`."""

import ast
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import hsp_control

HEAVY = {"numpy", "pinocchio", "scipy", "pydantic", "matplotlib"}


def imported(code: str, **environment: str) -> set[str]:
    """Return the modules that a fresh interpreter has imported after some code."""
    tail = "\nimport sys, json; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    ran = subprocess.run(
        [sys.executable, "-c", code + tail],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(json.loads(ran.stderr.splitlines()[-1]))


STUBS = sorted(Path(hsp_control.__file__).parent.rglob("__init__.pyi"))


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_every_name_of_a_stub_is_there_and_is_exported(stub: Path) -> None:
    """Editors and type checkers read what is looked up at run time."""
    room = ".".join(
        stub.parent.relative_to(Path(hsp_control.__file__).parents[1]).parts
    )
    module = import_module(room)
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        assert isinstance(node, ast.ImportFrom)
        (name,) = node.names
        assert name.asname == name.name  # else a stub does not export it
        if node.module != "companions" or name.name in hsp_control.companions.__all__:
            assert name.name in dir(module)
            assert getattr(module, name.name) is not None


def test_the_stub_names_every_companion() -> None:
    """So that an editor completes ``hsp.plots.``"""
    stub = Path(hsp_control.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    for name in hsp_control.companions.__all__:
        assert f"from .companions import {name} as {name}\n" in stub


def test_all_names_exist_and_are_listed() -> None:
    assert len(set(hsp_control.__all__)) == len(hsp_control.__all__)
    for name in hsp_control.__all__:
        assert getattr(hsp_control, name) is not None
    assert set(hsp_control.__all__) <= set(dir(hsp_control))
    with pytest.raises(AttributeError, match=r"has no attribute 'Robto'$"):
        _ = hsp_control.Robto


@pytest.mark.smoke
@pytest.mark.process
def test_the_law_reads_alone() -> None:
    """The law of equation (13) imports some twenty modules, and no declarations."""
    modules = imported("import hsp_control.law")
    assert not modules & {"pydantic", "pinocchio", "hsp_control.robot"}
    assert len([name for name in modules if name.startswith("hsp_control")]) <= 25


def test_few_names_are_at_the_top() -> None:
    """The top level has the common names; a hint points to the others."""
    assert len(hsp_control.__all__) - len(NAMESPACES) <= 45
    message = r"no attribute 'Spline'; there is hsp_control\.trajectories\.Spline$"
    with pytest.raises(AttributeError, match=message):
        _ = hsp_control.Spline
    # `changes` imports this name, but does not define it.
    message = r"no attribute 'Trajectory'; there is hsp_control\.trajectories"
    with pytest.raises(AttributeError, match=message):
        _ = hsp_control.Trajectory


NAMESPACES = [
    name
    for name in hsp_control.__all__
    if isinstance(getattr(hsp_control, name), ModuleType)
]


@pytest.mark.parametrize("namespace", NAMESPACES)
def test_each_namespace_has_its_own_names(namespace: str) -> None:
    module = getattr(hsp_control, namespace)
    assert [name for name in vars(module) if name[0].isupper()]
    names = [name for name in dir(module) if not name.startswith("_")]
    homes = {name: getattr(module, name).__module__ for name in names}
    assert all(home.startswith("hsp_control.") for home in homes.values()), homes
    assert len(names) <= 45
    if namespace == "changes":  # one name is imported, the other is defined there
        assert "Trajectory" not in names
        assert "ChangeGains" in names


@pytest.mark.process
def test_importing_the_package_imports_nothing_heavy() -> None:
    assert not imported("import hsp_control") & HEAVY


@pytest.mark.process
@pytest.mark.parametrize("words", [["--help"], ["--version"], ["chekc"], ["run"]])
def test_hsp_answers_without_the_engine(words: list[str]) -> None:
    code = (
        f"from hsp_control.cli import main\ntry: main({words})\nexcept SystemExit: pass"
    )
    assert not imported(code) & HEAVY


FISH = {
    "_ARGCOMPLETE_SHELL": "fish",
    "_ARGCOMPLETE_DFS": "\t",
    "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
}
"""The environment that fish gives a command: it shows a help beside each choice."""


@pytest.mark.process
@pytest.mark.parametrize(
    ("line", "offered", "shell"),
    [
        ("hsp ch", "check ", {}),
        ("hsp check panda_ob", "panda_obstacle ", {}),
        ("hsp run paper/4", "paper/4_moving_obstacle ", {}),
        ("hsp ch", "check\tcheck a configuration without running it", FISH),
        ("hsp check panda_ob", "panda_obstacle\t", FISH),
    ],
)
def test_a_shell_completes_without_the_engine(
    line: str, offered: str, shell: dict[str, str], tmp_path: Path
) -> None:
    answer = tmp_path / "answer"
    code = (
        "import os\n"
        "end = os._exit\n"
        "def leave(status): raise SystemExit\n"
        "os._exit = leave\n"
        "from hsp_control.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "os._exit = end"
    )
    found = imported(
        code,
        _ARGCOMPLETE="1",
        COMP_LINE=line,
        COMP_POINT=str(len(line)),
        _ARGCOMPLETE_STDOUT_FILENAME=str(answer),
        **shell,
    )
    assert answer.read_text().strip("\013") == offered
    assert not found & HEAVY


@pytest.mark.process
def test_all_names_can_be_imported_at_once() -> None:
    """Lazy-loader's own switch for finding errors of imports, which users may set."""
    modules = imported("import hsp_control", EAGER_IMPORT="1")
    assert {"hsp_control.tasks", "hsp_control.companions.sweeps.results"} <= modules
