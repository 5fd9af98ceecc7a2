"""Run bundled configurations and export their pages, for the frames of the site.

    .venv/bin/python tools/replays.py [--brief] [NAME ...]

Writes ``docs/_static/replays``. A page that is newer than its configuration stays;
delete the folder to have all of them anew. With ``--brief`` all are one page, of a run
of a tenth of a second: enough to check that the site can be built.
"""

import shutil
import sys
from pathlib import Path

import hsp_control as hsp
from hsp_control.common.resources import bundled_configs

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "_static" / "replays"

NO_FIELD = {"fields": [{"type": "rest"}]}

REPLAYS: dict[str, dict[str, dict[str, object]]] = {
    "paper/4_moving_obstacle": {},
    "panda_obstacle": {"with the field": {}, "without": NO_FIELD},
    "panda_manipulability": {"with the field": {}, "without": NO_FIELD},
    "iiwa_null_space": {"with the field": {}, "without": NO_FIELD},
    "iiwa_singular": {},
    "dual_panda": {"with the field": {}, "without": NO_FIELD},
    "tiago_reach": {"with the field": {}, "without": NO_FIELD},
    "whole_body/talos_circle": {},
    "walking/talos_walk": {},
    "walking/solo12_trot": {},
}
"""Replays, and the runs that are compared in them: changes of the null space."""


def main() -> None:
    """Write the pages that are missing or old."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    known = bundled_configs()
    names = [name for name in sys.argv[1:] if name != "--brief"]
    brief = len(names) < len(sys.argv) - 1
    made: list[Path] = []
    for name in names or filter(known.__contains__, REPLAYS):
        page = FOLDER / f"{name.replace('/', '-')}.html"
        if page.exists() and page.stat().st_mtime > known[name].stat().st_mtime:
            continue
        if brief and made:
            shutil.copy(made[0], page)
            continue
        print(f"{name} ...", flush=True)
        runs = [_run(name, *each, brief=brief) for each in _compared(name)]
        hsp.viewer.export_html(runs, page)
        made.append(page)


def _compared(name: str) -> list[tuple[str, dict[str, object]]]:
    return list(REPLAYS[name].items()) or [(name.rsplit("/", 1)[-1], {})]


def _run(
    name: str, said: str, null_space: dict[str, object], *, brief: bool
) -> "hsp.viewer.ComparedRun":
    changes = [f"null_space.{key}={value}" for key, value in null_space.items()]
    if brief:
        changes.append("simulation.duration=0.1")
    experiment = hsp.load_experiment(name, *changes)
    return hsp.viewer.ComparedRun(
        said, experiment.robot, experiment.run(), experiment.controller
    )


if __name__ == "__main__":
    main()
