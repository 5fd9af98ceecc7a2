"""Film the README's animations: `make animations` (they are committed)."""

from math import pi
from pathlib import Path

import hsp_control as hsp
from hsp_control.visualization.viewer.export import FilmStyle, export_film

FOLDER = Path(__file__).parent / "figures"
PERIOD = 2.0 * pi / 3.0  # of the paper's circle and disk [s]
FRAME_RATE = 15.0  # Hz
NO_FIELD = "null_space.fields=[{type: rest}]"
VIEW = {"camera": [2.0, 0.75, 1.1], "show": {"influence": False}}


def main() -> None:
    """Write them into docs/figures."""
    film_paper()
    film_panda()
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
    for name, changes in (("with", ()), ("without", (NO_FIELD,))):
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


if __name__ == "__main__":
    main()
