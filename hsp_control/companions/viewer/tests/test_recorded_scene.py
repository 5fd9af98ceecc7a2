"""A run with a mesh obstacle is repeated and drawn without the mesh's file."""

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.companions.viewer.obstacles import logged_shapes
from hsp_control.companions.viewer.replay import rebuild_run
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import packaged_folders
from hsp_control.simulation import Rollout

ROCK = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
RUN = """
robot: {name: ur5}
scene:
  obstacles:
    rock: {shape: {type: mesh, file: rock.obj}, center: {type: hold, point: [1, 0, 1]}}
tasks:
  tool: {type: frame_position, trajectory: {type: hold, origin: start}}
null_space:
  fields:
    - {type: obstacle_clearance, obstacles: [rock], influence: 2}
simulation: {duration: 0.05}
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return the log of a run with a mesh obstacle, whose files are in `project`."""
    project = tmp_path / "project"
    project.mkdir()
    (project / "rock.obj").write_text(ROCK)
    (project / "run.yaml").write_text(RUN)
    log = tmp_path / "log" / "run.npz"
    hsp.load_experiment(project / "run.yaml").run().save(log)
    return log


def test_a_run_beside_a_mesh_is_repeated_without_its_file(log: Path) -> None:
    before = Rollout.load(log)
    shutil.rmtree(log.parents[1] / "project")
    again = hsp.load_experiment(log).run()
    np.testing.assert_array_equal(again.q, before.q)
    again.save(log)
    np.testing.assert_array_equal(hsp.load_experiment(log).run().q, before.q)


def test_a_mesh_is_drawn_without_its_file(
    log: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shutil.rmtree(log.parents[1] / "project")
    run = rebuild_run(Rollout.load(log), "run")
    assert run.controller is not None
    assert isinstance(logged_shapes(run.rollout)["rock"], Mesh)
    assert not caplog.records


def test_a_mesh_that_has_changed_is_that_of_the_log(
    log: Path, caplog: pytest.LogCaptureFixture
) -> None:
    before = Rollout.load(log)
    (log.parents[1] / "project" / "rock.obj").write_text(ROCK.replace("0.1", "-0.5"))
    again = hsp.load_experiment(log).run()
    np.testing.assert_array_equal(again.q, before.q)
    assert "rock.obj" in caplog.text


def test_an_untrusted_log_writes_no_mesh_and_its_ball_is_named(
    log: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shutil.rmtree(log.parents[1] / "project")
    with caplog.at_level(logging.WARNING):
        access = only_within([log.parents[1], *packaged_folders()])
        run = rebuild_run(Rollout.load(log), "run", access)
        shape = logged_shapes(run.rollout)["rock"]
    assert not isinstance(shape, Mesh)
    assert "rock.obj; a ball around it is drawn" in caplog.text
