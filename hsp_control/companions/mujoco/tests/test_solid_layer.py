"""The solids of a plant: drawn at their poses, moved as in the log."""

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.companions.viewer.motion import motion_of
from hsp_control.companions.viewer.obstacles import (
    points_around,
    solid_layer,
)
from hsp_control.companions.viewer.run_drawing import LAYERS, all_layers

pytest.importorskip("mujoco")


def poses_of(commands):
    """Return the poses that commands set, shapes (4, 4)."""
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
    layer = solid_layer(motion, "/solids")
    commands = list(layer.draw(1.0))
    assert len(poses_of(commands)) == 2
    assert len(commands) == 4
    tracks = list(layer.tracks(motion))
    assert [track.property for track in tracks] == ["position", "quaternion"]
    assert len({track.path for track in tracks}) == 1, "the stand is fixed"
    np.testing.assert_array_equal(tracks[0].values, run["plant.solid.box.position"])
    (entry,) = layer.legend()
    assert entry.name == "solids box, stand"
    # The whole box is in view.
    upper = points_around(run).max(axis=0)
    assert upper[2] > run["plant.solid.box.position"][:, 2].max() + 0.1
    assert "solids" in all_layers(experiment.robot, motion, experiment.controller)
    assert "solids" in LAYERS
