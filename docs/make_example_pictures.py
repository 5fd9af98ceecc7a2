"""Draw a picture of every example: `make example-pictures` (they are committed).

Each example runs in a copy of its folder, and its page is photographed at a moment.
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

from PIL import Image

from hsp_control.companions.film import FilmStyle, export_film
from hsp_control.simulation import Rollout

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "figures" / "examples"
SIZE = (480, 320)
RUNS = {  # example: its log, and the moment [s]
    "own_urdf.py": ("own_urdf", 1.8),
    "xacro_gripper.yaml": ("xacro_gripper", 1.6),
    "two_arms.yaml": ("two_arms", 3.0),
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
FIGURES = ("paper_figure.py", "sweep.py", "lesson.ipynb", "gymnasium_pusher.py")
"""Examples that draw, or that are drawn here otherwise."""


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
    log, moment = RUNS[name]
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
    style = FilmStyle(SIZE, 1.0, plots=False, caption=False, start=moment, end=moment)
    os.chdir(folder)  # where the log's own code is
    export_film(Rollout.load(found), file, style=style, background="#FFFFFF")


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
        script = script.replace('"Pusher-v5"', '"Pusher-v5", render_mode="rgb_array"')
        script = script.replace("env.close()", "picture = env.render()\nenv.close()")
        os.environ.setdefault("MUJOCO_GL", "egl")
    exec(compile(script, name, "exec"), space)
    if "picture" in space:
        Image.fromarray(space["picture"]).save(picture)
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
