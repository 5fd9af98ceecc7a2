"""Film the animations of README and docs: `make animations` (they are committed)."""

from math import pi
from pathlib import Path

import hsp_control as hsp
from hsp_control.companions.film import FilmStyle, export_film

FOLDER = Path(__file__).parent / "figures"
PERIOD = 2.0 * pi / 3.0  # of the paper's circle and disk [s]
FRAME_RATE = 15.0  # Hz
NO_FIELD = ("null_space.fields.0.weight=0", "null_space.fields.1.weight=0")
VIEW = {
    "camera": [2.0, 0.75, 1.1],
    "background": "#10171E",  # the stage of the demo's page
    "show": {"influence": False},
}


def main() -> None:
    """Write them into docs/figures."""
    film_paper()
    film_panda()
    film_walking()
    for file in sorted(FOLDER.glob("*.webp")):
        size = file.stat().st_size / 1e6
        print(f"Animation: {file.relative_to(FOLDER.parents[1])}, {size:.2f} MB")


def film_paper() -> None:
    """Film one period of the fourth simulation, after many others: without a seam."""
    rollout = hsp.load_experiment("paper/4_moving_obstacle").run()
    start = 3.0 * PERIOD
    pictures = round(PERIOD * FRAME_RATE)
    step = PERIOD / pictures  # so that the last picture is one step before the first
    style = FilmStyle(
        size=(420, 420),
        frame_rate=1.0 / step,
        plots=False,
        caption=False,
        start=start,
        end=start + PERIOD - 0.5 * step,
    )
    export_film(rollout, FOLDER / "paper_4.webp", style=style)


def film_panda() -> None:
    """Film the Panda whose elbow a ball sweeps past, with its field and without."""
    for name, changes in (("with", ()), ("without", NO_FIELD)):
        rollout = hsp.load_experiment("panda_obstacle", *changes).run()
        style = FilmStyle(
            size=(420, 420),
            frame_rate=FRAME_RATE,
            speed=2.0,
            plots=False,
            caption=False,
            end=9.99,
        )
        export_film(rollout, FOLDER / f"panda_{name}.webp", style=style, **VIEW)


def film_walking() -> None:
    """Film the plans: Talos walks, Solo trots; the camera stands beside their way."""
    feet = {"paths": False, "targets": False, "self_motion": False}
    views = {
        "talos_walk": ([0.9, -3.4, 1.5], [0.5, 0.0, 0.87], 5.5),
        "solo12_trot": ([0.7, -1.25, 0.5], [0.42, 0.0, 0.12], 4.0),
    }
    for name, (camera, target, end) in views.items():
        rollout = hsp.load_experiment(f"walking/{name}").run()
        style = FilmStyle(
            size=(480, 300),
            frame_rate=FRAME_RATE,
            plots=False,
            caption=False,
            end=end,
        )
        view = {"camera": camera, "target": target, "show": feet}
        export_film(rollout, FOLDER / f"{name}.webp", style=style, **view)


if __name__ == "__main__":
    main()
