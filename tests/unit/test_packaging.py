"""Copies of values in pyproject.toml agree with it."""

import importlib.util
import re
import shlex
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.tags import Tag
from places import ROOT

from hsp_control import __version__

if not (ROOT / "pyproject.toml").is_file():
    pytest.skip("not in a checkout", allow_module_level=True)

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())

SHOWN = PROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
"""The page on PyPI."""

IN_CONDA = {
    "pin": "pinocchio",
    "matplotlib": "matplotlib-base",
    "meshcat": "meshcat-python",
    "cmeel-eigen": "eigen",
    "cmeel-boost": "libboost-headers",
}
"""Names in conda-forge of packages that are named differently on PyPI."""


def conda_form(text: str) -> str:
    """Return a requirement of pip as conda writes it, its bounds in order."""
    requirement = Requirement(text)
    bounds = ",".join(sorted(map(str, requirement.specifier), reverse=True))
    return f"{IN_CONDA.get(requirement.name, requirement.name)} {bounds}".strip()


def test_conda_has_the_requirements_of_pip() -> None:
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    python = f"python {PROJECT['project']['requires-python']}"
    expected = ["__linux", python, *map(conda_form, PROJECT["project"]["dependencies"])]
    assert recipe["requirements"]["run"] == expected
    build = [conda_form(each) for each in PROJECT["build-system"]["requires"]]
    assert recipe["requirements"]["host"] == [python, "pip", *build]
    scripts = PROJECT["project"]["scripts"].items()
    points = recipe["build"]["python"]["entry_points"]
    assert points == [f"{name} = {target}" for name, target in scripts]
    assert recipe["about"]["summary"] == PROJECT["project"]["description"]
    assert recipe["about"]["license"] == PROJECT["project"]["license"]
    licenses = {
        file.relative_to(ROOT).as_posix()
        for pattern in PROJECT["project"]["license-files"]
        for file in ROOT.glob(pattern)
    }
    reported = recipe["about"]["license_file"]  # also of removed companions
    assert {each for each in reported if (ROOT / each).parents[1].is_dir()} == licenses


def test_every_file_has_the_package_s_version() -> None:
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    changes = (ROOT / "CHANGELOG.md").read_text()
    newest = re.search(r"^## \[(\d[^]]*)\] - (.*)$", changes, re.MULTILINE)
    assert newest is not None
    assert recipe["context"]["version"] == __version__
    assert citation["version"] == __version__
    assert newest.groups() == (__version__, str(citation["date-released"]))


def included() -> set[str]:
    """Return the top-level content of the source distribution."""
    listed = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    always = {"LICENSE", "pyproject.toml"}
    return {name.lstrip("/") for name in listed} | always


def test_the_source_distribution_has_the_files_of_tests() -> None:
    read = {
        name
        for file in (ROOT / "tests").rglob("*.py")
        for name in re.findall(r'\bROOT / "([^"/]+)', file.read_text(encoding="utf-8"))
    }
    assert {"docs", "examples"} <= read
    assert read - {"out", ".git"} <= included()  # written; asked for, not read


def containerfile() -> list[list[str]]:
    """Return the words of each instruction."""
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    text = re.sub(r"^#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ")
    return [shlex.split(line) for line in text.splitlines() if line.strip()]


def test_the_container_has_the_sources_of_the_wheel() -> None:
    copied = {
        name
        for word, *names in containerfile()
        if word == "COPY" and not names[0].startswith("--from")
        for name in names[:-1]
    }
    targets = PROJECT["tool"]["hatch"]["build"]["targets"]
    needed = {
        "pyproject.toml",
        "constraints.txt",
        "engine",
        "hatch_build.py",
        *(each["path"] for each in SHOWN["fragments"]),
    }
    included_parts = {part.split("/")[0] for part in targets["wheel"]["only-include"]}
    assert copied >= needed | included_parts
    assert {
        file.relative_to(ROOT).parts[0]
        for pattern in PROJECT["project"]["license-files"]
        for file in ROOT.glob(pattern)
    } <= copied
    assert all((ROOT / name).exists() for name in copied)
    admitted = (ROOT / ".dockerignore").read_text().split()
    assert {f"!{name}" for name in copied} <= set(admitted)
    assert copied <= included()


@pytest.fixture
def hatch_build() -> ModuleType:
    pytest.importorskip("hatchling")
    file = importlib.util.spec_from_file_location("_", ROOT / "hatch_build.py")
    assert file is not None
    assert file.loader is not None
    module = importlib.util.module_from_spec(file)
    file.loader.exec_module(module)
    return module


def test_one_process_builds_at_a_time(hatch_build: ModuleType, tmp_path: Path) -> None:
    """CI compiles while pip fetches packages; pip builds in the same folder then."""
    fcntl = pytest.importorskip("fcntl")
    at_once = fcntl.LOCK_EX | fcntl.LOCK_NB
    with (tmp_path / ".lock").open("w") as other:
        with hatch_build.alone(tmp_path), pytest.raises(BlockingIOError):
            fcntl.flock(other, at_once)
        fcntl.flock(other, at_once)


@pytest.mark.parametrize(
    ("compiler", "library", "tag"),
    [
        ("g++", "_engine.abi3.so", "cp312-abi3-linux_aarch64"),
        ("g++", "_engine.cpython-314t-linux.so", "cp314-cp314t-linux_aarch64"),
        ("zig", "_engine.abi3.so", "cp312-abi3-manylinux_2_17_aarch64"),
        ("zig", "_engine.cpython-314t-linux.so", "cp314-cp314t-manylinux_2_17_aarch64"),
    ],
)
def test_a_wheel_names_the_platform_of_its_library(
    hatch_build: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    compiler: str,
    library: str,
    tag: str,
) -> None:
    systems = "manylinux_2_36_aarch64", "musllinux_1_2_aarch64", "linux_aarch64"
    mine = [Tag("cp314", "cp314t", system) for system in systems]
    monkeypatch.setattr(hatch_build, "sys_tags", lambda: iter(mine))
    monkeypatch.setattr(hatch_build.platform, "machine", lambda: "aarch64")
    monkeypatch.setenv("CXX", compiler)
    assert hatch_build.wheel_tag(library) == tag


@pytest.mark.parametrize(
    ("python", "cmake", "enough"),
    [
        ((3, 11), None, False),
        ((3, 11), "3.18.0", True),
        ((3, 12), None, False),
        ((3, 12), "3.25.1", False),  # without the stable ABI, silently
        ((3, 12), "3.26.0-rc1", True),
        ((3, 12), "4.4.5", True),
    ],
)
def test_a_cmake_with_the_stable_abi(
    hatch_build: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    python: tuple[int, int],
    cmake: str | None,
    enough: bool,
) -> None:
    if cmake:
        tool = tmp_path / "cmake"
        tool.write_text(f"#!/bin/sh\necho cmake version {cmake}\n")
        tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(hatch_build.sys, "version_info", python)
    assert hatch_build.has_cmake() == enough
    assert any("cmake" in name for name in hatch_build.tools()) != enough
