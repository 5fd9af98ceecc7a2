"""The package's public names, and the cost of importing it and starting `hsp`."""

import ast
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

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


def test_types_and_names_agree() -> None:
    """A type checker reads the names that are looked up at run time."""
    tree = ast.parse(Path(hsp_control.__file__).read_text(encoding="utf-8"))
    seen = {
        name.asname or name.name: (node.module, name.name)
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    names = {name: (room, name) for name, room in hsp_control._HOMES.items()}
    for name, room in hsp_control._NAMESPACES.items():
        outer, _, inner = room.rpartition(".")
        names[name] = (outer or None, inner)
    for name in hsp_control._companions():  # so that an editor completes hsp.plots.
        names[name] = ("companions", name)
    # The line of a removed companion may stay.
    assert {k: v for k, v in seen.items() if k in names} == names
    assert {v[0] for k, v in seen.items() if k not in names} <= {"companions"}


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
    names = [name for name in hsp_control._HOMES if name not in hsp_control._NAMESPACES]
    assert len(names) <= 45
    message = r"no attribute 'Spline'; there is hsp_control\.trajectories\.Spline$"
    with pytest.raises(AttributeError, match=message):
        _ = hsp_control.Spline
    # `changes` imports this name, but does not define it.
    message = r"no attribute 'Trajectory'; there is hsp_control\.trajectories"
    with pytest.raises(AttributeError, match=message):
        _ = hsp_control.Trajectory


@pytest.mark.parametrize("namespace", hsp_control._NAMESPACES)
def test_each_namespace_has_its_own_names(namespace: str) -> None:
    module = getattr(hsp_control, namespace)
    assert module is import_module(f"hsp_control.{hsp_control._NAMESPACES[namespace]}")
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
