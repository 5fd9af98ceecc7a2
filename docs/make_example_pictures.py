"""Draw a picture of every example: `make example-pictures` (they are committed).

Examples run in a copy of their folder; a picture of the page is taken at a given time.
Give names, such as `elbow.py`, to draw only these.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image, ImageChops

from hsp_control.companions.film import FilmStyle, export_film
from hsp_control.simulation import Rollout

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "figures" / "examples"
SIZE = (480, 320)
RUNS: dict[str, tuple[str, *tuple[float, ...]]] = {
    # example: its log, and the moment [s], or several side by side
    "own_urdf.py": ("own_urdf", 1.3, 2.9),
    "xacro_gripper.yaml": ("xacro_gripper", 1.57, 2.62),
    "two_arms.yaml": ("two_arms", 2.4, 4.0),
    "own_cost.py": ("own_cost_function", 2.9),
    "own_cost.yaml": ("own_cost", 1.2),
    "moving_obstacle.yaml": ("moving_obstacle", 2.2),
    "keep_out.yaml": ("keep_out", 1.6),
    "loop_500hz.py": ("loop_500hz", 1.7),
    "watch_a_loop.py": ("watch_a_loop", 2.5),
    "joystick.py": ("joystick", 1.9),
    "elbow.py": ("elbow", 2.0),
    "impedance.py": ("impedance", 1.8),
    "wipe.yaml": ("wipe", 2.6),
    "payload.py": ("payload_unknown", 1.6),
    "policy_chunks.py": ("policy_chunks", 2.2),
    "mujoco_model.py": ("mujoco_model", 2.0),
    "franka_arm.py": ("franka_arm", 1.5),
}
VIEWS: dict[str, dict[str, Any]] = {  # where the run's own view hides the idea
    "own_urdf.py": {"camera": [2.1, 1.5, 1.3], "target": [0.1, 0.0, 0.68]},
    "xacro_gripper.yaml": {
        "camera": [0.75, 0.16, 1.12],
        "target": [0.02, 0.0, 0.98],
        "show": {"targets": False, "paths": False},
    },
    "two_arms.yaml": {
        "camera": [1.9, 0.25, 0.95],
        "target": [0.3, 0.0, 0.48],
        "show": {"frames": True},
    },
}
OVERLAID = (
    "own_urdf.py",
    "two_arms.yaml",
)  # the second moment pale behind the first one
FIGURES = ("paper_figure.py", "sweep.py", "lesson.ipynb", "gymnasium_pusher.py")
"""Examples that draw, or that are drawn here otherwise."""
LIT = """
light = env.unwrapped.model.vis.headlight
light.ambient[:], light.diffuse[:] = 0.45, 0.5
picture = env.render()
"""


def main() -> None:
    """Write them into docs/figures/examples."""
    FOLDER.mkdir(exist_ok=True)
    chosen = sys.argv[1:] or [*RUNS, *FIGURES]
    for name in chosen:
        with TemporaryDirectory() as place:
            folder = Path(place) / "examples"
            shutil.copytree(ROOT / "examples", folder)
            file = FOLDER / f"{name.replace('.', '_')}.webp"
            if name in RUNS:
                photograph(name, folder, file)
            else:
                draw(name, folder, file)
        print(f"Picture: {file.relative_to(ROOT)}, {file.stat().st_size / 1e3:.0f} kB")


def photograph(name: str, folder: Path, file: Path) -> None:
    """Run an example, and show its log at a moment."""
    log, *moments = RUNS[name]
    if name == "franka_arm.py":
        words = ["hsp_control", "franka-box", "panda_obstacle", "--lockstep"]
        box = subprocess.Popen(
            [sys.executable, "-u", "-m", *words], cwd=folder, stdout=subprocess.PIPE
        )
        assert box.stdout is not None
        box.stdout.readline()  # it listens
        try:
            run_python(name, folder, "127.0.0.1")
        finally:
            box.terminate()
            box.wait()
    elif name.endswith(".yaml"):
        run_python("-m", folder, "hsp_control", "run", name)
    else:
        run_python(name, folder)
    found = next(folder.glob(f"out/{log}.*"))
    view = {"background": "#FFFFFF", **VIEWS.get(name, {})}
    wide = SIZE[0] if name in OVERLAID else SIZE[0] // len(moments)
    os.chdir(folder)  # where the log's own code is
    picture = Image.new("RGB", SIZE, "white")
    for k, moment in enumerate(moments):
        at = {"start": moment, "end": moment}
        style = FilmStyle((wide, SIZE[1]), 1.0, plots=False, caption=False, **at)
        export_film(Rollout.load(found), file, style=style, **view)
        taken = Image.open(file).convert("RGB")
        if k and name in OVERLAID:
            white = Image.new("RGB", SIZE, "white")
            picture = ImageChops.darker(picture, Image.blend(white, taken, 0.35))
        else:
            picture.paste(taken, (k * wide, 0))
    if len(moments) > 1:
        picture.save(file, quality=80, method=6)


def draw(name: str, folder: Path, file: Path) -> None:
    """Run an example, and keep the figure that it draws."""
    picture = folder / "out" / "picture.png"
    if name.endswith(".ipynb"):
        cells = json.loads((folder / name).read_text())["cells"]
        code = [
            "".join(each["source"]) for each in cells if each["cell_type"] == "code"
        ]
        script = "\n".join(code).replace("hsp.plots.diag", "figure = hsp.plots.diag")
    else:
        script = (folder / name).read_text()
    space: dict[str, Any] = {}
    os.chdir(folder)
    (folder / "out").mkdir(exist_ok=True)
    if name == "gymnasium_pusher.py":
        near = {"distance": 1.9, "azimuth": 150.0, "elevation": -28.0}
        near["lookat"] = np.array([0.15, -0.35, -0.2])
        space |= {"size": {"width": 2 * SIZE[0], "height": 2 * SIZE[1]}, "near": near}
        script = script.replace(
            '"Pusher-v5"',
            '"Pusher-v5", render_mode="rgb_array", default_camera_config=near, **size',
        )
        script = script.replace("env.close()", f"{LIT}\nenv.close()")
        os.environ.setdefault("MUJOCO_GL", "egl")
    exec(compile(script, name, "exec"), space)
    if "picture" in space:
        pixels = space["picture"].copy()
        pixels[(pixels < 2).all(axis=2)] = 255  # there is nothing
        Image.fromarray(pixels).save(picture)
    else:
        space["figure"].savefig(picture, dpi=160)
    image = Image.open(picture).convert("RGB")
    image.thumbnail((SIZE[0], 2 * SIZE[1]))
    image.save(file, quality=80, method=6)


def run_python(name: str, folder: Path, *arguments: str) -> None:
    """Run a script, or a module, in a folder."""
    subprocess.run([sys.executable, name, *arguments], cwd=folder, check=True)


if __name__ == "__main__":
    main()
