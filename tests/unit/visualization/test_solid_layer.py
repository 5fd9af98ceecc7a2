"""The solid things of a plant: drawn where they are, moved as the log says."""

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.visualization.viewer.motion import motion_of
from hsp_control.visualization.viewer.obstacle_layer import SolidLayer, solids_of
from hsp_control.visualization.viewer.run_drawing import LAYERS, all_layers

pytest.importorskip("mujoco")
BOX = {"type": "Box", "size": [0.2, 0.3, 0.1]}
STAIRS = {
    "type": "Solid", "name": "stairs", "shape": BOX, "position": [1, 0, 0.05],
    "rotation": [0, 0, np.pi / 2], "copies": 3, "spacing": [0.2, 0, 0.1],
}  # fmt: skip


def poses_of(commands):
    """Return the poses that commands set, shape (4, 4) each."""
    return [
        np.frombuffer(c.packed[-128:], "<f8").reshape(4, 4).T
        for c in commands
        if c.key.endswith("transform")
    ]


@pytest.fixture(scope="module")
def carried():
    experiment = load_experiment("forces/pandas_box", "simulation.duration=0.02")
    run = experiment.run()
    return experiment, run, motion_of(experiment.robot, run)


def test_solids_are_drawn_where_they_are_and_loose_ones_move(carried):
    experiment, run, motion = carried
    layer = SolidLayer(motion, "/solids")
    assert layer.names == ["box", "stand"]
    commands = list(layer.draw(1.0))
    assert len(poses_of(commands)) == 2
    assert len(commands) == 4
    tracks = list(layer.tracks(motion))
    assert [track.property for track in tracks] == ["position", "quaternion"]
    assert len({track.path for track in tracks}) == 1, "the stand is fixed"
    np.testing.assert_array_equal(tracks[0].values, run["plant.solid.box.position"])
    (entry,) = layer.legend()
    assert entry.name == "solids box, stand"
    # The whole box is in sight.
    upper = layer.points().max(axis=0)
    assert upper[2] > run["plant.solid.box.position"][:, 2].max() + 0.1
    assert "solids" in all_layers(experiment.robot, motion, experiment.controller)
    assert "solids" in LAYERS


def test_copies_stand_beside_one_another(carried):
    _, run, motion = carried
    run.meta["plant"], before = {"solids": [STAIRS]}, run.meta["plant"]
    try:
        commands = list(SolidLayer(motion, "/solids").draw(1.0))
    finally:
        run.meta["plant"] = before
    poses = poses_of(commands)
    assert len(poses) == 3
    for k, pose in enumerate(poses):
        np.testing.assert_allclose(pose[:3, 3], [1 + 0.2 * k, 0, 0.05 + 0.1 * k])
        np.testing.assert_allclose(pose[:2, 0], [0, 1], atol=1e-12)


@pytest.mark.parametrize("meta", [{}, {"plant": None}, {"plant": {}}])
def test_a_log_without_solids_draws_none(meta):
    assert solids_of(meta) == []
