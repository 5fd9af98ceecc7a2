"""An exported page contains the log within tolerances, in few bytes."""

import base64
import gzip
import io
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from places import THOROUGH, further
from scipy.spatial import cKDTree

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.errors import ExportError, ViewerError
from hsp_control.companions.viewer import ComparedRun, export_html, robot_of
from hsp_control.companions.viewer.export_page import write_page
from hsp_control.companions.viewer.packing import (
    VERTEX_STEP,
    ArrayTable,
    read_mesh,
    smooth_mesh,
)
from hsp_control.companions.viewer.page_plots import (
    CURVE_BOUND,
    pack_panels,
)
from hsp_control.companions.viewer.targets import read_targets

MEGABYTE = 1e6
PLANAR = "paper/4_moving_obstacle"
# As configured, a run takes minutes without compiled kernels.
COARSE = (
    "simulation.control_period=null",
    "simulation.integrator={type: rk4, step: 0.01}",
)
TALOS = {
    "title": "Talos",
    "robot": {"name": "talos", "root": "fixed"},
    "tasks": {
        side: {
            "type": "frame_position",
            "frame": f"gripper_{side}_base_link",
            "trajectory": {
                "type": "circle",
                "origin": "start",
                "center": [0, 0, 0],
                "radius": 0.08,
                "angular_rate": 2,
                "normal": [1, 0, 0],
            },
            "gains": {"natural_frequency": 10},
            "blend": 1,
        }
        for side in ("left", "right")
    },
    "null_space": {"gain": 5, "fields": [{"type": "joint_centering", "weight": 1}]},
    "simulation": {
        "duration": 10 if THOROUGH else 0.5,
        "integrator": {"type": "rk4", "step": 0.01},
    },
}


@pytest.fixture(scope="module")
def planar() -> Rollout:
    return load_experiment(PLANAR, "simulation.duration=3").run()


@pytest.fixture(scope="module")
def panda() -> Rollout:
    return load_experiment("panda_obstacle", *COARSE).run()


# -- numbers --------------------------------------------------------------------------


def unpacked(entry: dict[str, Any]) -> np.ndarray:
    """The inverse of packing.py, as in unpack.js."""
    data = entry["bytes"]
    data = np.frombuffer(getattr(data, "data", data), np.uint8)
    rows, columns, width = entry["rows"], entry["columns"], entry["width"]
    planes = data.reshape(width, columns, rows).astype(np.int64)
    zigzag = sum(planes[k] << 8 * k for k in range(width))
    whole = np.asarray((zigzag >> 1) ^ -(zigzag & 1)).T
    return np.array(entry["offset"]) + np.cumsum(whole, axis=0) * entry["step"]


@given(
    st.lists(
        st.tuples(*[st.floats(-1e6, 1e6, allow_nan=False, width=32)] * 2), max_size=40
    ),
    st.sampled_from([1e-6, 1e-3, 0.5, 1e4]),
)
def test_numbers_come_back_within_half_a_step(
    rows: list[tuple[float, float]], step: float
) -> None:
    values = np.reshape(rows, (-1, 2))
    table = ArrayTable()
    table.numbers(values, step)
    (entry,) = table.entries
    steps = np.array(entry["step"])
    assert (steps >= step).all()
    assert (steps <= max(step, 2e6 / (2**31 - 1)) * 1.0001).all()
    error = np.abs(unpacked(entry) - values)
    assert (error <= 0.5 * steps * (1.0 + 1e-6) + 1e-9).all()


def test_equal_arrays_are_kept_once() -> None:
    table = ArrayTable()
    wave = np.sin(np.arange(50.0))
    first = table.numbers(wave, 1e-4)
    assert table.numbers(wave.copy(), 1e-4) == first
    assert table.numbers(wave + 1.0, 1e-4) != first
    assert table.numbers(wave, 1e-3) != first
    assert len(table.entries) == 3
    whole = table.whole(np.array([7, 0, 255], np.uint8))
    entry = table.entries[whole["$array"]]
    assert entry["kind"] == "Uint8Array"
    np.testing.assert_array_equal(unpacked(entry).ravel(), [7, 0, 255])


# -- meshes ---------------------------------------------------------------------------


def mesh_of(robot: Robot, recorder_path: Path, **about: Any) -> dict[str, Any]:
    suffix = recorder_path.suffix.lower()[1:]
    text = recorder_path.read_text() if suffix == "dae" else recorder_path.read_bytes()
    kind = "_meshfile_object" if suffix == "dae" else "_meshfile_geometry"
    return {"type": kind, "format": suffix, "data": text, **about}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["talos", "kinova", *further("panda", "ur5")])
def test_meshes_are_read_as_pinocchio_reads_them(name: str) -> None:
    robot = Robot.load(name)
    geometry = pin.buildGeomFromUrdf(
        robot.model,
        str(robot.source.urdf),
        pin.GeometryType.VISUAL,
        package_dirs=[str(folder) for folder in robot.source.package_dirs],
    )
    read = 0
    for item in list(geometry.geometryObjects)[::5]:
        file = Path(item.meshPath)
        if file.suffix.lower() not in {".dae", ".stl"}:
            continue
        read += 1
        pieces = read_mesh(mesh_of(robot, file), item.name)
        vertices = np.vstack([piece.vertices for piece in pieces]) * item.meshScale
        before = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
        triangles = [p.triangles + n for p, n in zip(pieces, before[:-1], strict=True)]
        expected = item.geometry.vertices()
        used = vertices[np.unique(np.concatenate(triangles))]
        tolerance = 1e-5 * np.ptp(expected, axis=0).max()
        for these, those in ((used, expected), (expected, used)):
            assert cKDTree(these).query(those)[0].max() < tolerance
    assert read > 1


def collada(matrix: str, effect: str, extra: str = "", uv: str = "") -> str:
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.001"/><up_axis>Y_UP</up_axis></asset>
{extra}
<library_effects><effect id="e"><profile_COMMON>{effect}</profile_COMMON></effect>
</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material>
</library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#pa" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common>
</source>{uv}
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="s"><input semantic="VERTEX" source="#v" offset="0"/>
{'<input semantic="TEXCOORD" source="#u" offset="0" set="0"/>' if uv else ""}
<p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><matrix>{matrix}</matrix>
<instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="s" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


PLAIN = (
    "<technique sid='t'><lambert><diffuse><color>1 0.5 0 1</color></diffuse></lambert>"
    "</technique>"
)


def test_a_collada_file_keeps_its_place_colour_and_outside() -> None:
    mirrored = "-2 0 0 0.5  0 2 0 0  0 0 2 0  0 0 0 1"
    thing = {"type": "_meshfile_object", "format": "dae", "resources": {}}
    (piece,) = read_mesh({**thing, "data": collada(mirrored, PLAIN)}, "it")
    assert piece.color == pytest.approx((1.0, 0.5, 0.0, 1.0), abs=0.01)
    corners = piece.vertices[piece.triangles[0]]
    # Neither unit nor up axis has an effect; the node's own matrix does.
    assert {tuple(corner) for corner in corners.tolist()} == {
        (0.5, 0.0, 0.0), (-1.5, 0.0, 0.0), (0.5, 2.0, 0.0),
    }  # fmt: skip
    # Mirrored, but still seen from above.
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] > 0.0


def test_a_mesh_is_smoothed_once_for_each_use() -> None:
    """Its own colours are those of an object, not of a geometry."""
    thing = {"format": "dae", "data": collada("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", PLAIN)}
    kinds = "_meshfile_object", "_meshfile_geometry"
    first, again = (
        [smooth_mesh({**thing, "type": kind}, "it") for kind in kinds] for _ in range(2)
    )
    assert [pieces[0].color is None for pieces in first] == [False, True]
    assert all(one is other for one, other in zip(first, again, strict=True))


def test_a_texture_becomes_its_mean_colour() -> None:
    picture = Image.new("RGB", (8, 8), (200, 40, 20))
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    address = f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"
    effect = (
        "<newparam sid='f'><surface type='2D'><init_from>i</init_from></surface>"
        "</newparam><newparam sid='a'><sampler2D><source>f</source></sampler2D>"
        "</newparam><technique sid='t'><lambert><diffuse><texture texture='a' "
        "texcoord='UV'/></diffuse></lambert></technique>"
    )
    images = (
        "<library_images><image id='i'><init_from>skin.png</init_from></image>"
        "</library_images>"
    )
    uv = (
        '<source id="u"><float_array id="ua" count="6">0 0 1 0 0 1</float_array>'
        '<technique_common><accessor source="#ua" count="3" stride="2"><param name="S" '
        'type="float"/><param name="T" type="float"/></accessor></technique_common>'
        "</source>"
    )
    text = collada("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", effect, images, uv)
    thing = {"type": "_meshfile_object", "format": "dae", "data": text}
    (piece,) = read_mesh({**thing, "resources": {"skin.png": address}}, "it")
    assert piece.color is not None
    expected = [200 / 255, 40 / 255, 20 / 255]
    np.testing.assert_allclose(piece.color[:3], expected, atol=0.02)


def test_a_mesh_that_cannot_be_read_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    thing = {"type": "_meshfile_object", "format": "dae", "data": "<COLLADA/>"}
    with pytest.raises(ExportError, match=r"/robot/hand: its mesh cannot be read"):
        read_mesh(thing, "/robot/hand")
    for module in ("trimesh", "collada"):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, module, None)
            message = rf"/robot/hand is drawn from .* needs {module}: pip install"
            with pytest.raises(ExportError, match=message):
                read_mesh(thing, "/robot/hand")


# -- the page -------------------------------------------------------------------------


def content_of(page: Path) -> dict[str, Any]:
    """The content of a page, with its arrays inserted."""
    text = page.read_text(encoding="utf-8")
    block = re.search(r'id="content">([^<]*)<', text)
    assert block is not None
    content = umsgpack.unpackb(gzip.decompress(base64.b64decode(block[1])))
    arrays = [unpacked(entry) for entry in content["arrays"]]

    def revived(value: Any) -> Any:
        if isinstance(value, dict):
            if "$array" in value:
                return arrays[value["$array"]]
            return {key: revived(item) for key, item in value.items()}
        if isinstance(value, list):
            return [revived(item) for item in value]
        return value

    return {key: revived(content[key]) for key in content if key != "arrays"}


def tracks_of(content: dict[str, Any]) -> dict[tuple[str, str], tuple[Any, Any]]:
    (clip,) = (c for c in content["commands"] if c["type"] == "clip")
    return {
        (track["path"], track["property"]): (
            clip["clocks"][track["clock"]].ravel(),
            track["values"],
        )
        for track in clip["tracks"]
    }


@pytest.mark.slow
def test_every_joint_is_where_the_log_has_it(panda: Rollout, tmp_path: Path) -> None:
    page = export_html(panda, tmp_path / "panda.html")
    assert page.stat().st_size < 2.0 * MEGABYTE
    content = content_of(page)
    tracks = tracks_of(content)
    robot = Robot.load("panda")
    data = robot.model.createData()
    at = {}
    for joint in robot.model.names[1:]:
        times, positions = tracks[f"/robot/{joint}", "position"]
        clock, turns = tracks[f"/robot/{joint}", "quaternion"]
        at[joint] = rows_at(times, positions, panda.t), rows_at(clock, turns, panda.t)
    for row, q in enumerate(panda.q):
        pin.forwardKinematics(robot.model, data, q)
        for joint, (positions, turns) in at.items():
            placement = data.oMi[robot.model.getJointId(joint)]
            off = np.linalg.norm(positions[row] - placement.translation)
            assert off <= 3e-5
            shown = pin.Quaternion(*turns[row][[3, 0, 1, 2]])
            turned = shown.normalized().angularDistance(
                pin.Quaternion(placement.rotation)
            )
            assert turned <= 1e-4


def rows_at(times: np.ndarray, values: np.ndarray, t: np.ndarray) -> Any:
    """The rows of a track at the times of a log; a constant one has one row."""
    rows = np.abs(times[:, None] - t).argmin(axis=0)
    assert len(times) == 1 or np.abs(times[rows] - t).max() <= 1e-6
    return values[rows]


@pytest.mark.slow
def test_talos_fits_and_its_mirrored_side_is_mirrored(tmp_path: Path) -> None:
    experiment = load_experiment(TALOS)
    rollout = experiment.run()
    page = export_html(rollout, tmp_path / "talos.html")
    assert page.stat().st_size < 4.0 * MEGABYTE
    robot = experiment.robot
    geometry = pin.buildGeomFromUrdf(
        robot.model,
        str(robot.source.urdf),
        pin.GeometryType.VISUAL,
        package_dirs=[str(folder) for folder in robot.source.package_dirs],
    )
    mirrored = 0
    objects = {
        command["path"]: command["object"]
        for command in content_of(page)["commands"]
        if command["type"] == "set_object" and command["path"].startswith("/robot/")
    }
    for item in geometry.geometryObjects:
        if Path(item.meshPath).suffix.lower() not in {".dae", ".stl"}:
            continue
        link, _, number = item.name.rpartition("_")
        joint = robot.model.names[item.parentJoint]
        thing = objects[f"/robot/{joint}/{link}"]
        node = thing["object"]["children"][int(number)]
        vertices = world_vertices(thing, node)
        expected = item.placement.act(pin.SE3.Identity())  # where its origin is
        points = np.array([expected.act(v) for v in item.geometry.vertices()])
        for these, those in ((vertices, points), (points, vertices)):
            assert cKDTree(these).query(those)[0].max() < 4.0 * VERTEX_STEP
        mirrored += int(np.prod(item.meshScale) < 0.0)
    assert mirrored > 10


def world_vertices(thing: dict[str, Any], node: dict[str, Any]) -> np.ndarray:
    matrix = np.reshape(node.get("matrix", np.eye(4)), (4, 4)).T
    if "children" in node:
        points = np.vstack([world_vertices(thing, c) for c in node["children"]])
    else:
        (geometry,) = (g for g in thing["geometries"] if g["uuid"] == node["geometry"])
        points = geometry["data"]["attributes"]["position"]["array"]
    return points @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.slow
def test_the_page_needs_nothing_from_anywhere(planar: Rollout, tmp_path: Path) -> None:
    page = export_html(planar, tmp_path / "new" / "page.html")
    text = page.read_text(encoding="utf-8")
    shown = re.sub(r'(id="(?:scripts|content)">)[^<]*', r"\1", text)
    addresses = re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?([^"\')\s>]+)', shown)
    assert set(addresses) <= {"data:,"}
    assert "default-src 'none'" in text
    assert "connect-src" not in text
    assert str(tmp_path) not in text
    assert not list(page.parent.glob(".*"))
    again = export_html(planar, tmp_path / "again.html")
    assert abs(again.stat().st_size - page.stat().st_size) < 2000  # names are numbered
    assert page.stat().st_size < 0.5 * MEGABYTE


def test_runs_of_files_whose_names_are_not_utf8_are_compared(
    planar: Rollout, tmp_path: Path
) -> None:
    name = b"caf\xe9".decode(errors="surrogateescape")
    runs = [ComparedRun(n, robot_of(planar), planar) for n in (name, "b")]
    page = export_html(runs, tmp_path / "page.html")
    names = content_of(page)["runs"]["names"]
    assert names == ["caf\\udce9", "b"]


@pytest.mark.parametrize("row", [0, 7])
@pytest.mark.filterwarnings("error")
def test_a_target_without_numbers_stays(
    row: int, panda: Rollout, tmp_path: Path
) -> None:
    name = "task.hand.reference"
    damaged = panda[name].copy()
    damaged[row] = np.nan
    log = Rollout({**panda.columns, name: damaged}, panda.meta)
    kept = read_targets(log)[0].desired
    assert kept is not None
    whole = read_targets(panda)[0].desired
    assert whole is not None
    np.testing.assert_array_equal(kept[row], whole[row - 1 if row else 1])
    export_html(log, tmp_path / "page.html")
    damaged[:] = np.nan
    log = Rollout({**panda.columns, name: damaged}, panda.meta)
    assert read_targets(log)[0].desired is None
    export_html(log, tmp_path / "page.html")


def logged(rollout: Rollout) -> ComparedRun:
    return ComparedRun("", robot_of(rollout), rollout)


def test_the_plots_are_the_logs(panda: Rollout) -> None:
    table = ArrayTable()
    packed = pack_panels([logged(panda)], table)
    arrays = [unpacked(entry) for entry in table.entries]
    assert (packed["start"], packed["end"]) == (0.0, 10.0)
    panels = {panel["title"]: panel for panel in packed["panels"]}
    assert list(panels) == [
        "Task error ‖e‖",
        "Null-space error ‖e_N‖",
        "Minimum distance",
        "Joint positions",
        "Determinant",
        "Value of the field",
        "Efforts τ",
    ]

    def curve(panel: dict[str, Any], place: int) -> np.ndarray:
        series = panel["series"][place]
        times, values = (arrays[series[key]["$array"]] for key in ("times", "values"))
        return np.interp(panda.t, times.ravel(), values.ravel())

    for place in range(7):
        panel = panels["Joint positions"]
        error = np.abs(curve(panel, place) - panda["joint_positions"][:, place])
        assert error.max() <= CURVE_BOUND * (panel["high"] - panel["low"]) * 1.01
    panel = panels["Null-space error ‖e_N‖"]
    assert [s["name"] for s in panel["series"]] == ["predicted: exp(−10 t)", "‖e_N‖"]
    height = panel["high"] - panel["low"]
    shown = np.log10(panda["null_space_norm"]).clip(panel["low"] - height)
    assert np.abs(curve(panel, 1) - shown).max() <= CURVE_BOUND * height * 1.01
    points = sum(len(a) for a in arrays)
    assert points < 0.3 * 2 * len(panda) * 21


def test_where_the_law_is_bounded_the_plots_are_marked(planar: Rollout) -> None:
    damped = np.zeros(len(planar))
    damped[[10, 11, 12, 50]] = 1.0
    damped[-3:] = 1.0
    changed = Rollout({**planar.columns, "damped": damped}, planar.meta)
    t = planar.t
    expected = [(t[10], t[13]), (t[50], t[51]), (t[-3], t[-1])]
    packed = pack_panels([logged(changed)], ArrayTable())
    assert packed["damped"] == [expected]


def test_where_a_curve_has_no_numbers_it_has_a_gap(planar: Rollout) -> None:
    t, none = planar.t, np.full(len(planar), np.nan)
    error = planar["task.tip.error"].copy()
    error[:3] = error[10:12] = error[-2:] = np.nan
    columns = {"task.tip.error": error, "manipulability": none}
    table = ArrayTable()
    changed = Rollout(planar.columns | columns, planar.meta)
    packed = pack_panels([logged(changed)], table)
    panels = {panel["title"]: panel for panel in packed["panels"]}
    assert "Determinant" not in panels
    (curve,) = panels["Task error ‖e‖"]["series"]
    assert curve["gaps"] == [(t[0], t[3]), (t[10], t[12]), (t[-2], t[-1])]
    (whole,) = panels["Value of the field"]["series"]
    assert whole["gaps"] == []
    # What is drawn beside a gap does not fall to the end of the axis.
    values = unpacked(table.entries[curve["values"]["$array"]])
    assert values.min() >= panels["Task error ‖e‖"]["low"]


@pytest.mark.parametrize("values", [[np.nan] * 4, [0.0] * 4, [1.0, np.inf, 0.5, -1.0]])
def test_undrawable_parts_do_not_break_the_page(
    values: list[float], planar: Rollout
) -> None:
    columns = {name: column[:4].copy() for name, column in planar.columns.items()}
    for name in ("manipulability", "null_space_norm", "task.tip.error"):
        columns[name] = np.reshape(values, (4, 1)) * np.ones_like(
            np.reshape(columns[name], (4, -1))
        )
        columns[name] = columns[name].reshape(planar[name][:4].shape)
    table = ArrayTable()
    run = logged(Rollout(columns, planar.meta))
    for panel in pack_panels([run], table)["panels"]:
        assert np.isfinite([panel["low"], panel["high"]]).all()
        assert panel["low"] < panel["high"]
    assert all(np.isfinite(unpacked(entry)).all() for entry in table.entries)


def test_unexportable_logs_are_reported(
    planar: Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = {k: v for k, v in planar.meta["robot"].items() if k != "record"}
    meta = {k: v for k, v in planar.meta.items() if k != "config"}
    anonymous = Rollout(planar.columns, {**meta, "robot": robot})
    with pytest.raises(ViewerError, match="made from Python"):
        export_html(anonymous, tmp_path / "page.html")
    named = export_html(anonymous, tmp_path / "page.html", robot=Robot.load("planar3r"))
    assert named.is_file()
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(ExportError, match=r"file/page\.html: cannot write the page"):
        export_html(planar, blocked / "page.html")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ExportError, match=r"^\.: cannot write the page"):
        write_page(Path(), "")


def test_a_command_without_a_file_names_the_missing_argument(
    planar: Rollout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(planar.save(tmp_path / "run.npz"))]) == 2
    assert "give a file with one of --html" in capsys.readouterr().err
