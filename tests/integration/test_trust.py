"""Untrusted files: no code runs, no other file is read, sizes are bounded."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaigns.mutate_urdf import ARM, EXTERNAL, LAUGHS
from campaigns.mutate_yaml import TAGS
from campaigns.urdf_case import DAE, OBJ, STL

from hsp_control import HspControlError, Robot, load_experiment
from hsp_control.cli import main
from hsp_control.common.errors import (
    AccessError,
    ConfigError,
    LogError,
    ModelError,
    SceneError,
    SimulationError,
)
from hsp_control.companions.plots.figures import diagnostics_figure
from hsp_control.companions.viewer.threejs import collada_object
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot.description.access import (
    ANYWHERE,
    MAX_DEPTH,
    XmlError,
    check_no_document_type,
    only_within,
    parse_xml,
)
from hsp_control.robot.description.urdf import MAX_DOFS, MAX_LINKS
from hsp_control.simulation import Rollout

CONFIG = """robot: {name: ROBOT}
tasks:
  hand: {type: frame_position, trajectory: {type: hold}}
null_space: {gain: 5, fields: [{type: self_clearance}]}
simulation: {duration: 0.01, control_period: 0.001,
  integrator: {type: rk4, step: 0.001}}
"""
MESH = """scene:
  obstacles:
    thing: {shape: {type: mesh, file: MESH}, center: {type: hold, point: [9, 9, 9]}}
"""


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """An untrusted folder with a configuration, a robot and its mesh; another next to
    it."""
    folder, outside = tmp_path / "theirs", tmp_path / "mine"
    for where in (folder, outside):
        where.mkdir()
        (where / "good.stl").write_bytes(STL)
        (where / "arm.urdf").write_text(ARM)
    (folder / "config.yaml").write_text(CONFIG.replace("ROBOT", "arm.urdf"))
    return folder


def write(home: Path, robot: str = "arm.urdf", more: str = "") -> Path:
    path = home / "config.yaml"
    path.write_text(CONFIG.replace("ROBOT", robot) + more)
    return path


# --- code ----------------------------------------------------------------------------


@pytest.mark.parametrize("tag", TAGS)
def test_no_code_runs_from_yaml(tag: str, tmp_path: Path) -> None:
    canary, path = tmp_path / "canary", tmp_path / "config.yaml"
    path.write_text(f"robot: {tag.format(canary=canary)}\n")
    with pytest.raises(ConfigError, match=r"config.yaml:1: "):
        load_experiment(path)
    with pytest.raises(ConfigError):
        load_experiment("panda_limits", f"title={tag.format(canary=canary)}")
    assert not canary.exists()


def test_no_pickle_is_opened(tmp_path: Path) -> None:
    """The canary works: unpickling by NumPy triggers it."""

    class Touch:
        def __reduce__(self) -> tuple[Any, ...]:
            return (open, (str(canary), "w"))

    canary, path = tmp_path / "canary", tmp_path / "log.npz"
    np.savez(path, t=np.array([Touch()], dtype=object))
    with pytest.raises(LogError, match=r"not a complete \.npz log"):
        Rollout.load(path)
    assert not canary.exists()
    with np.load(path, allow_pickle=True) as archive:
        archive["t"].item().close()
    assert canary.exists()


# --- paths ---------------------------------------------------------------------------


def test_a_robot_elsewhere_is_refused_and_allowed(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outside = home.parent / "mine"
    for robot in ("../mine/arm.urdf", str(outside / "arm.urdf"), "/etc/hostname.urdf"):
        config = write(home, robot)
        message = r"config.yaml:1: robot.name: robot '.*' resolves to .*; .*--allow /"
        with pytest.raises(AccessError, match=message):
            load_experiment(config, strict=True)
    config = write(home, str(outside / "arm.urdf"))
    load_experiment(config)
    load_experiment(config, strict=True, allow=[outside])
    assert main(["check", str(config), "--strict"]) == 2
    reported = capsys.readouterr().err
    assert reported.startswith(
        f"hsp: {config}:1: robot.name: robot '{outside}/arm.urdf'"
    )
    assert reported.count("\n") == 1
    assert main(["live", str(config), "--strict"]) == 2
    assert capsys.readouterr().err == reported
    assert main(["check", str(config), "--allow", str(outside)]) == 0
    assert main(["check", str(config)]) == 0


def test_links_are_followed_before_they_are_judged(home: Path) -> None:
    (home / "link.urdf").symlink_to("../mine/arm.urdf")
    (home / "folder").symlink_to("../mine")
    (home / "loop.urdf").symlink_to("loop.urdf")
    for robot in ("link.urdf", "folder/arm.urdf", "loop.urdf"):
        with pytest.raises((AccessError, HspControlError)):
            load_experiment(write(home, robot), strict=True)
    with pytest.raises(AccessError):
        load_experiment(write(home, str(home / "link.urdf")), strict=True)
    (home / "inside.urdf").symlink_to("arm.urdf")
    load_experiment(write(home, "inside.urdf"), strict=True)


@pytest.mark.parametrize("name", [
    "../mine/good.stl",
    "MINE/good.stl",
    "file://MINE/good.stl",
    "package://../mine/good.stl",
    "package://theirs/../mine/good.stl",
    "/nowhere/there/is/nothing.stl",
    "link.stl",
    "good.ply",
])  # fmt: skip
@pytest.mark.parametrize("tag", ["collision", "visual"])
def test_meshes_elsewhere_are_refused(home: Path, name: str, tag: str) -> None:
    (home / "link.stl").symlink_to("../mine/good.stl")
    (home / "good.ply").write_bytes(b"ply")
    mesh = name.replace("MINE", str(home.parent / "mine"))
    text = ARM.replace("good.stl", mesh).replace("collision>", f"{tag}>")
    (home / "arm.urdf").write_text(text)
    with pytest.raises(AccessError, match=r"arm.urdf: link 'upper': <mesh>"):
        load_experiment(write(home), strict=True)
    with pytest.raises(AccessError):
        Robot.load(home / "arm.urdf", access=only_within([home]))
    assert Robot.load(home / "arm.urdf").nv == 3  # dynamics need no meshes


def test_an_obstacle_s_mesh_elsewhere_is_refused(home: Path) -> None:
    config = write(home, more=MESH.replace("MESH", "../mine/good.stl"))
    load_experiment(config)
    where = r"config.yaml:\d+: scene.obstacles.thing.shape.file: mesh '.*/good.stl' res"
    with pytest.raises(AccessError, match=where):
        load_experiment(config, strict=True)


@pytest.mark.parametrize(("suffix", "text"), [("obj", OBJ), ("dae", DAE.encode())])
def test_files_named_in_a_mesh_are_checked_too(
    home: Path, suffix: str, text: bytes
) -> None:
    """OBJ names material libraries, Collada pictures."""
    (home / f"thing.{suffix}").write_bytes(text)
    (home / "arm.urdf").write_text(ARM.replace("good.stl", f"thing.{suffix}"))
    with pytest.raises(AccessError, match=r"its reference '.*/etc/passwd'"):
        Robot.load(home / "arm.urdf", access=only_within([home]))


def test_a_log_is_a_stranger_s_file_too(home: Path, tmp_path: Path) -> None:
    """Configuration and obstacles name files, which a replay reads."""
    outside = str(home.parent / "mine")
    config = write(home, f"{outside}/arm.urdf", MESH.replace("MESH", "good.stl"))
    log = load_experiment(config).run().save(home / "run.npz")
    page = ["--html", str(tmp_path / "page.html")]
    with pytest.raises(AccessError):
        load_experiment(log, strict=True)
    assert main(["run", str(log), "--strict", "--out", str(tmp_path)]) == 2
    assert main(["export", str(log), *page, "--strict"]) == 2
    assert main(["view", str(log), "--strict", "--no-browser"]) == 2
    assert not (tmp_path / "page.html").exists()
    assert main(["export", str(log), *page, "--allow", outside]) == 0


def test_a_page_carries_pictures_and_nothing_else(tmp_path: Path) -> None:
    """Also without strict reading: pages are passed on to others."""
    secret, mesh = tmp_path / "secret", tmp_path / "thing.dae"
    for name in ("secret", "picture.png"):
        (tmp_path / name).write_bytes(b"mine")
        mesh.write_text(DAE.replace("/etc/passwd", name))
        carried = collada_object(mesh)["object"]["resources"]
        assert list(carried) == ([] if name == secret.name else [name])


def test_access() -> None:
    assert ANYWHERE.allows(Path("/etc/passwd"))
    assert not only_within(["/tmp"]).allows(Path("/tmp/../etc/passwd"))
    assert not only_within(["/tmp/a"]).allows(Path("/tmp/ab"))
    assert not only_within(["/tmp"]).allows(Path("/tmp/\0"))


# --- XML -----------------------------------------------------------------------------


@pytest.mark.parametrize("head", [LAUGHS, EXTERNAL, "<!DOCTYPE robot>"])
def test_document_types_are_refused(head: str, home: Path) -> None:
    (home / "arm.urdf").write_text(head + ARM)
    with pytest.raises(ModelError, match=r"arm.urdf:\d: a document type"):
        Robot.load(home / "arm.urdf")
    with pytest.raises(XmlError, match="a document type"):
        check_no_document_type((head + "<COLLADA/>").encode())
    (home / "thing.dae").write_text(head + DAE.partition("?>")[2])
    with pytest.raises(SceneError, match=r"thing.dae: line \d: a document type"):
        Mesh(home / "thing.dae").geometry()
    (home / "arm.urdf").write_text(ARM.replace("good.stl", "thing.dae"))
    with pytest.raises(ModelError, match=r"collision mesh: .*thing.dae: line"):
        load_experiment(write(home))


def test_depth_and_elements_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    deep = "<x>" * (MAX_DEPTH + 1) + "</x>" * (MAX_DEPTH + 1)
    with pytest.raises(XmlError, match="nested deeper than 100 levels"):
        parse_xml(deep.encode())
    monkeypatch.setattr("hsp_control.robot.description.access.MAX_ELEMENTS", 10)
    with pytest.raises(XmlError, match="more than 10 elements"):
        parse_xml(b"<x>" + b"<y/>" * 10 + b"</x>")


NONSENSE = [
    ('mass value="2"', 'mass value="nan"', r"<mass>: value=\"nan\" is not finite"),
    ('mass value="2"', 'mass value="-2"', "a mass must not be negative"),
    ('mass value="2"', 'mass value="1e300"', r"is too large; at most 1e.09 \(SI units"),
    ('mass value="2"', 'mass value="two"', 'value="two" must be a number'),
    ('ixx="0.1"', 'ixx="-0.1"', "a principal moment is -0.1 kg·m²; must not be neg"),
    ('xyz="0 1 0"', 'xyz="0 0 0"', r"joint 'shoulder': <joint>: axis .* not be zero"),
    ('upper="3"', 'upper="inf"', r"'shoulder': <limit>: upper=\"inf\" is not fin"),
    ('xyz="0 0 0.4"', 'xyz="0 0"', r'xyz="0 0" must be 3 numbers'),
    ('radius="0.1"', 'radius="-0.1"', 'radius="-0.1" must not be negative'),
    ('filename="good.stl"', 'filename=" "', "the filename is missing"),
    ('scale="1 1 1"', 'scale="1 0 1"', 'scale="1 0 1": a factor must not be zero'),
]


@pytest.mark.parametrize(("good", "bad", "message"), NONSENSE)
def test_numbers_that_no_robot_has(
    good: str, bad: str, message: str, home: Path
) -> None:
    assert good in ARM
    (home / "arm.urdf").write_text(ARM.replace(good, bad, 1))
    with pytest.raises(ModelError, match=message):
        Robot.load(home / "arm.urdf")


# --- sizes ---------------------------------------------------------------------------


def test_links_are_bounded(home: Path) -> None:
    links = "".join(f'<link name="l{k}"/>' for k in range(MAX_LINKS))
    (home / "arm.urdf").write_text(ARM.replace("</robot>", links + "</robot>"))
    with pytest.raises(ModelError, match=r"1004 links; at most 1000"):
        Robot.load(home / "arm.urdf")
    joints = "".join(f'<joint name="j{k}" type="floating"/>' for k in range(MAX_DOFS))
    (home / "arm.urdf").write_text(ARM.replace("</robot>", joints + "</robot>"))
    with pytest.raises(ModelError, match=r"203 moving joints; at most 200"):
        Robot.load(home / "arm.urdf")


@pytest.mark.parametrize("module", ["access", "mesh_files"])
def test_files_are_bounded(
    module: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"hsp_control.robot.description.{module}.MAX_SIZE", 200)
    with pytest.raises(ModelError, match=r"larger than|collision mesh: .*at most"):
        load_experiment(home / "config.yaml")


@pytest.mark.parametrize(("overrides", "message"), [
    (["duration=1e9", "log_period=0.01"], r"simulation: .* 1e.11 rows; at most 1e.07"),
    (["duration=10", "control_period=1e-9"], r"1e.10 steps; at most 1e.09"),
    (["integrator={type: rk4, step: 1e-12}"], r"integrator.step: .* steps; at most"),
])  # fmt: skip
def test_runs_that_would_not_end_are_refused(
    overrides: list[str], message: str, home: Path
) -> None:
    with pytest.raises(SimulationError, match=message):
        load_experiment(
            home / "config.yaml", *(f"simulation.{text}" for text in overrides)
        )


def test_a_log_too_large_is_refused_before_it_is_computed(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = load_experiment(home / "config.yaml")
    monkeypatch.setattr("hsp_control.simulation.log_columns.MAX_SIZE", 100)
    with pytest.raises(SimulationError, match="a log of 2 rows is larger than"):
        experiment.run()


@pytest.fixture(scope="module")
def run() -> Rollout:
    return load_experiment("paper/4_moving_obstacle", "simulation.duration=0.05").run()


def test_sparse_logs_are_drawn(run: Rollout, tmp_path: Path) -> None:
    """Without tasks, field, gain and metric; with an obstacle of its own type."""
    path = run.save(tmp_path / "log.npz")
    log = Rollout.load(path)
    for entry in ("tasks", "field", "null_space_gain", "metric", "versions", "columns"):
        del log.meta[entry]
    log.meta["obstacles"]["disk"].update(shape="Egg", parameters={"yolk": 1})
    log.save(path)
    assert main(["plot", str(path), "--out", str(tmp_path)]) == 0
    assert main(["export", str(path), "--html", str(tmp_path / "page.html")]) == 0
    (axes, *_) = diagnostics_figure(Rollout.load(path)).axes
    assert [line.get_label() for line in axes.lines] == ["the log has no task"]
