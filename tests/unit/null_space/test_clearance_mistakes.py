"""Wrong shapes, obstacles and starts in contact are refused by name."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from clearance_cases import AIR, still
from field_cases import placed
from loaded_robots import load
from odd_robots import collision, odd_robot
from wording import wording

from hsp_control import NullSpaceField, Obstacle, Robot, load_experiment
from hsp_control.common.errors import (
    FieldError,
    HspControlError,
    ModelError,
    SceneError,
)
from hsp_control.geometry import Proximity, link_shapes
from hsp_control.geometry.shapes import Mesh, Sphere
from hsp_control.null_space.fields import ObstacleClearance, SelfClearance
from hsp_control.trajectories import Hold

BALL = Obstacle("ball", Sphere(0.1), Hold([0.5, 0.3, 0.5]))


def on(robot: Robot, field: NullSpaceField) -> NullSpaceField:
    """Place a field on a robot at rest at home, near the ball."""
    return placed(field, still(robot), [BALL])


MISTAKES: list[tuple[Callable[[Path], Any], type[HspControlError], str]] = [
    (lambda _: ObstacleClearance([]), FieldError,
     "... ObstacleClearance: obstacles: ... at least one"),
    (lambda _: placed(ObstacleClearance(), still(load("panda"))), FieldError,
     "the scene has no obstacle"),
    (lambda _: on(load("panda"), ObstacleClearance(["ball", "bell"])), SceneError,
     "obstacles.1: no ... 'bell' ... 'ball'"),
    (lambda _: ObstacleClearance([BALL], influence=0.0), FieldError,
     "ObstacleClearance: influence: 0.0 ... greater than 0"),
    (lambda _: SelfClearance(influence=float("nan")), FieldError,
     "SelfClearance: influence: nan ... finite"),
    (lambda _: on(load("panda"), ObstacleClearance([BALL], links=["panda_lnk3"])),
     FieldError, "... links.0: ... 'panda_lnk3' ... 'panda_link3'"),
    (lambda _: on(load("panda"), ObstacleClearance(links=["panda_link0"])),
     FieldError, "... no pairs of shapes"),
    (lambda _: Proximity(load("panda"), link_shapes(load("panda")), [], []), FieldError,
     "... no pairs of shapes"),
    (lambda at: on(odd_robot(at, collision('<sphere radius="1"/>')), SelfClearance()),
     FieldError, "... no pairs of shapes"),
    (lambda _: link_shapes(load("panda"), "boxes"),  # type: ignore[arg-type]
     ModelError, "... 'boxes' ... capsules, spheres, hulls, meshes"),
    (lambda at: on(load("panda"), ObstacleClearance(
        [Obstacle("it", Mesh(at / "no.stl"), AIR)])),
     SceneError, "... /no.stl"),
    (lambda at: Mesh(at / "no.stl").geometry(), SceneError, "... mesh: no such file"),
    (lambda at: Mesh(at).geometry(), SceneError, "... mesh: no such file"),
    (lambda at: Mesh(pipe(at)).geometry(), SceneError, "... a pipe, which may never"),
    (lambda at: Mesh(junk(at)).geometry(), SceneError, "... mesh: cannot read"),
    (lambda at: Mesh(junk(at)).bounding_radius, SceneError, "... junk.stl"),
]  # fmt: skip


def pipe(at: Path) -> Path:
    """Return a named pipe, which nobody writes."""
    os.mkfifo(at / "pipe.stl")
    return at / "pipe.stl"


def junk(folder: Path) -> Path:
    """Write a file that is no mesh."""
    file = folder / "junk.stl"
    file.write_bytes(b"solid nothing\nendsolid nothing\n")
    return file


@pytest.mark.parametrize(
    ("make", "error", "message"), MISTAKES, ids=[m[2][:40] for m in MISTAKES]
)
def test_every_mistake_is_named(
    make: Callable[[Path], Any],
    error: type[HspControlError],
    message: str,
    tmp_path: Path,
) -> None:
    with pytest.raises(error) as caught:
        make(tmp_path)
    assert re.search(wording(message), str(caught.value))
    assert "\n" not in str(caught.value)


TOUCHING = {
    "robot": {"name": "panda"},
    "tasks": {"hand": {"type": "frame_position", "trajectory": {"type": "hold"}}},
    "scene": {"obstacles": {"ball": {"shape": {"type": "sphere", "radius": 0.1},
           "center": {"type": "hold", "point": [0.2, 0.0, 0.7]}}}},
    "null_space": {"fields": [{"type": "obstacle_clearance"}]},
    "simulation": {"duration": 0.02},
}  # fmt: skip


def test_a_start_in_contact_is_refused_with_its_place() -> None:
    """A barrier cannot resolve an initial contact; pair and depth are named."""
    with pytest.raises(SceneError) as caught:
        load_experiment(TOUCHING)
    robot = load("panda")
    ball = Obstacle("ball", Sphere(0.1), Hold([0.2, 0.0, 0.7]))
    state = still(robot)
    d, pair = ObstacleClearance([ball]).proximity(state).nearest(state)
    assert d < 0.0
    reported = f"... null_space.fields.0: ... {pair}, {-d:.3g} m deep ... start: auto"
    assert re.search(wording(reported), str(caught.value))
    assert "to ball" in pair
    apart = json.loads(
        json.dumps(TOUCHING).replace("[0.2, 0.0, 0.7]", "[0.2, 0.3, 0.7]")
    )
    assert load_experiment(apart).run().status == "completed"
