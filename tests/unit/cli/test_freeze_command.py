"""``hsp freeze``: a configuration's controller for a program without Python."""

import re
from pathlib import Path

import pytest
from frozen_library import Opened

from hsp_control.cli import main
from hsp_control.frozen import cmake_folder, include_folder, library


def test_a_configuration_is_frozen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ["--out", str(tmp_path / "new"), "--set", "simulation.control_period=0.002"]
    assert main(["freeze", "panda_limits", *where]) == 0
    file = tmp_path / "new/panda_limits.hsp"
    assert str(file) in capsys.readouterr().out.replace("\n", "")
    assert Opened(file).get("period", 1).tolist() == [0.002]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ("whole_body/talos_circle", r"talos_circle.yaml:\d+: contacts.left_foot: "),
        ("walking/talos_walk", r"talos_walk.yaml:\d+: plan: "),
        ("compliance/panda_cartesian_impedance", r"\.yaml:\d+: changes: "),
    ],
)
def test_what_cannot_be_frozen_is_refused_with_its_place(
    config: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["freeze", config, "--out", str(tmp_path)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(message, said), said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "place"),
    [
        ("--cmake-dir", cmake_folder),
        ("--include-dir", include_folder),
        ("--library", library),
    ],
)
def test_where_the_library_is(
    option: str, place: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["freeze", option]) == 0
    assert capsys.readouterr().out.strip() == str(place())  # type: ignore[operator]


def test_nothing_to_freeze(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["freeze"]) == 2
    assert "needs a configuration" in capsys.readouterr().err
