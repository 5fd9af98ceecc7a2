"""Every command that reads logs reads the logs of every writer."""

from pathlib import Path

import pytest
from places import THOROUGH, further
from typing_commands import hsp, in_this_process, script

CONFIG = """
robot: {name: panda}
tasks: {hand: {type: frame_pose, trajectory: {type: hold}, blend: 1}}
null_space: {fields: [{type: joint_centering}]}
simulation: {duration: 0.2, control_period: 0.001}
"""
PYTHON = """
import pinocchio as pin
import hsp_control as hsp
from hsp_control.live import InProcessRobot, SimulatedRobot

robot = hsp.Robot.load("panda")
hand = hsp.FramePosition("panda_tcp")


def law(field):
    return hsp.Controller(robot, [hand], field)


own = hsp.FunctionCost(lambda state: state.q[3] ** 2, weight=0.01)
task = hsp.FunctionTask(lambda state: state.q[0], name="first")
both = hsp.Controller(robot, [hand, task])
run = {"duration": 0.05, "control_period": 0.001}
hsp.simulate(law(hsp.JointCentering()), robot.home(), **run).save("out/simulated.npz")
hsp.simulate(law(own), robot.home(), **run).save("out/function.npz")
hsp.simulate(both, robot.home(), **run).save("out/task.npz")
other = hsp.Robot.from_pinocchio(robot.model, home=robot.home())
arm = hsp.Controller(other, [hand])
with hsp.Recorder(arm, "out/from_pinocchio.npz") as recorder:
    for k in range(30):
        recorder.record(arm.compute(0.001 * k, robot.home(), [0.0] * 7))
arm = law(hsp.JointCentering())
with hsp.Recorder(arm, "out/recorded.npz") as recorder:
    for k in range(30):
        recorder.record(arm.compute(0.001 * k, robot.home(), [0.0] * 7))
plant = hsp.plants.IntegratedPlant(
    hsp.plants.RigidBodyPlant(robot), hsp.integrators.Rk4(0.001)
)
zero = [0.0] * 7
simulated = SimulatedRobot(plant, robot.home(), pin.utils.zero(7), 0.001)
hsp.run_loop(
    law(hsp.JointCentering()), InProcessRobot(simulated), duration=0.2,
    log="out/loop.journal",
)
"""
REPEATED = (
    *("mine", "mine-live", "mine-robot", "mine-play", "recorded"),
    *("simulated", "from_pinocchio", "loop"),
)
"""Logs whose configuration is plain data: `hsp run` repeats them."""
OTHERS = {  # by the output of `hsp run`
    "function": "was made from Python and contains no configuration",
    "task": "was made from Python and contains no configuration",
}

TAKERS = {
    "export {log} --html out/{name}.html": "{name}.html",
    "plot {log} --panels null_space": "{name}-null_space.png",
}
"""Commands and their outputs; unless thorough the logs are assigned in turn."""
LOGS = [*REPEATED, *OTHERS]
if not THOROUGH:  # written like a recorder's, and like that of a user's function
    LOGS = [each for each in LOGS if each not in {"simulated", "task"}]
VIEW = "view {log} --no-browser"
VIEWED = "mine", "loop"
"""And a walk; a view reads a log like an export."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    (folder / "mine.yaml").write_text(CONFIG)
    (folder / "logs.py").write_text(PYTHON)
    hsp("run mine.yaml", folder)
    hsp("live mine.yaml --lockstep", folder)
    hsp("play mine.yaml --no-browser", folder)
    script("logs.py", folder)
    return folder


@pytest.mark.parametrize("name", LOGS)
def test_a_log_is_taken(name: str, folder: Path) -> None:
    log = next((folder / "out").glob(f"{name}.*")).relative_to(folder)
    turn = slice(LOGS.index(name) % 2, None, 1 if THOROUGH else 2)
    for command, written in [*TAKERS.items()][turn]:
        in_this_process(command.format(log=log, name=name), folder)
        file = folder / "out" / written.format(name=name)
        assert file.stat().st_size > 10_000
    if name in VIEWED:
        in_this_process(VIEW.format(log=log), folder)
    if name in REPEATED:
        in_this_process(f"run {log}", folder)
    else:
        assert OTHERS[name] in in_this_process(f"run {log}", folder, status=2)


def test_a_walk_s_log_is_taken(folder: Path) -> None:
    in_this_process("run walking/solo12_trot --set simulation.duration=0.3", folder)
    (log,) = (path.relative_to(folder) for path in folder.glob("out/solo12_trot*.npz"))
    for command in (*TAKERS, "plot {log}", VIEW, "run {log}"):
        in_this_process(command.format(log=log, name="walk"), folder)


@pytest.mark.parametrize("workers", further(1))  # as in test_sweep_command.py
def test_a_sweep_s_file_is_drawn(workers: int, folder: Path) -> None:
    hsp(f"sweep mine.yaml --over null_space.gain=5,8 --workers {workers}", folder)
    hsp("plot out/mine-sweep.parquet", folder)
