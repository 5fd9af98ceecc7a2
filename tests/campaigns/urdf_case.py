"""One mutated URDF, with meshes, through ``check``, ``robots``, ``run``, ``export``."""

import os
import struct
import tempfile
from pathlib import Path
from random import Random

from campaigns.asking import ask
from campaigns.mutate_urdf import ARM, EXTERNAL, LAUGHS, mutated
from campaigns.texts import TRICKS
from hsp_control.common.resources import bundled_robots

STL = (
    b"\0" * 80
    + struct.pack("<I", 4)
    + b"".join(
        struct.pack("<12fH", 0, 0, 1, *corners, 0)
        for corners in (
            (0, 0, 0, 0.1, 0, 0, 0, 0.1, 0), (0, 0, 0, 0.1, 0, 0, 0, 0, 0.3),
            (0, 0, 0, 0, 0.1, 0, 0, 0, 0.3), (0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.3),
        )
    )
)  # fmt: skip
OBJ = b"mtllib ../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n"
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_images><image
id="i"><init_from>/etc/passwd</init_from></image></library_images>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">
0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source="#a" count="3"
stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z"
type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION"
source="#p"/></vertices><triangles count="1"><input semantic="VERTEX" source="#v"
offset="0"/>
<p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry
url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene
url="#s"/></scene></COLLADA>
"""

CONFIG = """robot: {name: mutated.urdf, root: ROOT}
tasks:
  hand: {type: frame_position, trajectory: {type: hold}}
null_space:
  gain: 5
  fields:
    - {type: joint_centering, weight: 1}
    - {type: self_clearance, weight: 1}
PLANT
simulation:
  {duration: 0.02, control_period: 0.001, integrator: {type: rk4, step: 0.001}}
"""


def case(seed: int, index: int) -> list[str]:
    """Return the outcome of case ``index``: see `worker`."""
    random = Random(f"urdf {seed} {index}")
    robots = [folder / f"{name}.urdf" for name, folder in bundled_robots().items()]
    bundled = random.random() < 0.5
    data = random.choice(robots).read_bytes() if bundled else ARM.encode()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_meshes(folder, random)
        (folder / "mutated.urdf").write_bytes(mutated(data, random))
        plant = "plant: {type: mujoco}" if random.random() < 0.2 else ""
        root = random.choice(("fixed", "fixed", "fixed", "planar"))
        config = folder / "config.yaml"
        config.write_text(CONFIG.replace("PLANT", plant).replace("ROOT", root))
        answer = ask(["check", str(config)])
        if answer[0] == "fine":
            answer = ask(["robots", str(folder / "mutated.urdf")])
        if answer[0] == "fine":
            answer = ask(["run", str(config), "--out", str(folder)], stop_after=2.0)
        if answer[0] == "fine":
            page = folder / "page.html"
            answer = ask(["export", str(folder / "config.npz"), "--html", str(page)])
            if page.exists() and b"cm9vdDp4" in page.read_bytes():  # root:x in base 64
                return ["unclear", "the page carries /etc/passwd away"]
    if "passwd" in answer[1] and "root:" in answer[1]:
        return ["unclear", answer[1]]
    return answer


def _write_meshes(folder: Path, random: Random) -> None:
    good = STL if random.random() < 0.7 else random.choice(TRICKS)(STL, random)
    (folder / "good.stl").write_bytes(good)
    for suffix, data in ((".stl", STL), (".obj", OBJ), (".dae", DAE.encode())):
        bad = random.choice(TRICKS)(data, random)
        (folder / f"bad{suffix}").write_bytes(bad)
    head = random.choice((LAUGHS, EXTERNAL))
    (folder / "laughs.dae").write_text(head + DAE.partition("?>")[2])
    os.mkfifo(folder / "pipe.stl")
