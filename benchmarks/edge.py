"""Targets at the edge of reach and beyond, under several torque laws.

    .venv-peers/bin/python benchmarks/edge.py [--old CHECKOUT] [ROBOT ...]

The cases of `shared/edge_cases.py`, the same for all laws; laws run in separate
processes, one after another (`shared/edge_loop.py`). The other laws are in
`shared/controllers`, with the gains that their projects ship for an arm like a Panda;
pink and TSID are their own packages, and are left out where they are not installed.
``--python LAW=PYTHON`` runs a law in another environment, which needs Pinocchio and the
law's package only. ``--old`` is a checkout of an earlier version of this package.
Writes tables into docs/measurements.md and benchmarks/results/edge.md.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from shared.edge_cases import cases
from shared.edge_loop import LAWS
from shared.marked_sections import RESULTS, replace_section

ROBOTS = ("panda", "ur5", "iiwa14", "xarm7")
OUT_OF_REACH = ("position", "pose", "stream")
NAMES = {
    "jacobian_transpose": "JᵀK, as crisp_controllers",
    "isaac_lab": "operational space, as Isaac Lab",
    "robosuite": "operational space, as robosuite",
    "pink": "pink {} + RNEA",
    "tsid": "TSID {}",
    "unbounded": "this law, without bounds",
    "old": "this law, {}",
    "ours": "this law",
}
"""How the tables call a law; with its version."""

HERE = Path(__file__).resolve().parent
Run = dict[str, Any]


def measured(law: str, given: Path, python: str, old: str | None) -> tuple[str, Any]:
    """Return the name of a law and its runs; or the name and why it has none."""
    results, environment = given.with_name(f"{law}.json"), dict(os.environ)
    if results.exists():
        return named(law, json.loads(results.read_text(encoding="utf-8")), old)
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if law == "old":
        if old is None:
            return NAMES[law].format("earlier"), "no checkout: --old"
        environment["PYTHONPATH"] = str(Path(old).resolve())
    command = [python, "-W", "ignore", "-m", "shared.edge_loop", given, law, results]
    done = subprocess.run(
        command, cwd=HERE, env=environment, check=False, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return NAMES[law].format("").replace("  ", " ").strip(), reason
    return named(law, json.loads(results.read_text(encoding="utf-8")), old)


def named(law: str, found: dict[str, Any], old: str | None) -> tuple[str, list[Run]]:
    """Return the name of a law and its runs."""
    version = version_of(Path(old)) if law == "old" and old else found["version"]
    return NAMES[law].format(version), found["runs"]


def version_of(checkout: Path) -> str:
    """Return the version of this package in a checkout."""
    text = (checkout / "hsp_control/common/version.py").read_text(encoding="utf-8")
    return text.split('"')[-2]


def of_kinds(runs: list[Run], *kinds: str) -> list[Run]:
    """Return the runs of some kinds of cases."""
    return [run for run in runs if run["kind"] in kinds]


def values(runs: list[Run], key: str, scale: float = 1.0) -> list[float]:
    """Return the numbers of runs, without those that have none."""
    return [scale * run[key] for run in runs if run[key] is not None]


def count(runs: list[Run], counts: Callable[[Run], bool]) -> str:
    """Return how many runs are such, of how many."""
    return f"{sum(counts(run) for run in runs)} of {len(runs)}"


def digits(number: float) -> str:
    """Return a number with two digits, or without decimals."""
    return f"{number:.0f}" if number >= 99.5 else f"{number:.2g}"


def most(found: list[float]) -> str:
    """Return the largest number."""
    return digits(max(found)) if found else "-"


def middle(found: list[float]) -> str:
    """Return the median."""
    return digits(float(np.median(found))) if found else "-"


def both(found: list[float]) -> str:
    """Return the median and the largest number."""
    return f"{middle(found)} / {most(found)}" if found else "-"


Column = tuple[str, Callable[[list[Run]], str]]

SHORT: tuple[Column, ...] = (
    (
        "comes to rest",
        lambda runs: count(of_kinds(runs, *OUT_OF_REACH), lambda run: run["rests"]),
    ),
    (
        "largest change of an effort in 1 ms / limit",
        lambda runs: most(values(of_kinds(runs, *OUT_OF_REACH), "change")),
    ),
    (
        "highest speed / limit",
        lambda runs: most(values(of_kinds(runs, *OUT_OF_REACH), "speed")),
    ),
    (
        "farthest beyond a joint's limit [rad]",
        lambda runs: most(beyond(of_kinds(runs, *OUT_OF_REACH))),
    ),
    (
        "from the nearest point [mm]",
        lambda runs: middle(values(of_kinds(runs, "position"), "away", 1e3)),
    ),
    (
        "error on circles [mm rms]",
        lambda runs: middle(values(of_kinds(runs, "circle"), "tracking", 1e3)),
    ),
    (
        "steps of 0.5 m settle in [s]",
        lambda runs: middle(values(of_kinds(runs, "step"), "settling")),
    ),
)
"""Columns of the table in docs/measurements.md."""

LONG: tuple[Column, ...] = (
    *(
        (
            f"rests: {kind}",
            lambda runs, kind=kind: count(of_kinds(runs, kind), lambda r: r["rests"]),
        )
        for kind in OUT_OF_REACH
    ),
    ("change in 1 ms / limit", lambda runs: both(values(reaching(runs), "change"))),
    ("speed / limit", lambda runs: both(values(reaching(runs), "speed"))),
    ("beyond a joint's limit [rad]", lambda runs: most(beyond(reaching(runs)))),
    *(
        (
            f"from the nearest point [mm]: {kind}",
            lambda runs, kind=kind: both(values(of_kinds(runs, kind), "away", 1e3)),
        )
        for kind in ("position", "pose")
    ),
    (
        "circles [mm rms]",
        lambda runs: both(values(of_kinds(runs, "circle"), "tracking", 1e3)),
    ),
    (
        "steps that settle",
        lambda runs: count(
            of_kinds(runs, "step"), lambda run: run["settling"] is not None
        ),
    ),
    ("after [s]", lambda runs: both(values(of_kinds(runs, "step"), "settling"))),
    (
        "diverges or fails",
        lambda runs: count(runs, lambda run: bool(run["end"] or run["unsolved"])),
    ),
)
"""Columns of the table in benchmarks/results/edge.md."""


def reaching(runs: list[Run]) -> list[Run]:
    """Return the runs whose target is out of reach."""
    return of_kinds(runs, *OUT_OF_REACH)


def beyond(runs: list[Run]) -> list[float]:
    """Return how far joints were beyond their limits, 0 for those that were not."""
    return [max(0.0, each) for each in values(runs, "beyond")]


def header(first: tuple[str, ...], columns: tuple[Column, ...], *last: str) -> str:
    """Return the first two lines of a table."""
    names = [*first, *(name for name, _ in columns), *last]
    rules = ["---"] * len(first) + ["--:"] * (len(columns) + len(last))
    return f"| {' | '.join(names)} |\n|{'|'.join(rules)}|\n"


def short_row(name: str, runs: list[Run], robots: list[str]) -> str:
    """Return a law's line: the first robot, and in brackets all that it steers."""
    steered = [each for each in robots if steers(of_robots(runs, each))]
    cells = []
    for _, column in SHORT:
        own = column(of_robots(runs, robots[0]))
        cells.append(f"{own} ({column(of_robots(runs, *steered))})")
    return f"| {name} | {' | '.join(cells)} | {len(steered)} of {len(robots)} |\n"


def of_robots(runs: list[Run], *robots: str) -> list[Run]:
    """Return the runs of some robots."""
    return [run for run in runs if run["robot"] in robots]


def steers(runs: list[Run]) -> bool:
    """Return whether a law keeps an arm where it can be: no circle diverges."""
    return not any(run["end"] for run in of_kinds(runs, "circle"))


def long_rows(name: str, runs: list[Run], robots: list[str]) -> str:
    """Return a law's lines, one per robot."""
    rows = ""
    for robot in robots:
        cells = [column(of_robots(runs, robot)) for _, column in LONG]
        rows += f"| {name} | {robot} | {' | '.join(cells)} |\n"
    return rows


def main() -> None:
    """Run all laws, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10, help="of a kind and robot")
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS))
    parser.add_argument("--old", help="a checkout of an earlier version")
    parser.add_argument(
        "--python", action="append", default=[], metavar="LAW=PYTHON",
        help="the environment of a law",
    )  # fmt: skip
    parser.add_argument(
        "--keep", type=Path, help="a folder of runs: those in it are not made again"
    )
    parser.add_argument("--dry", action="store_true", help="write no document")
    parser.add_argument("robots", nargs="*", default=list(ROBOTS))
    options = parser.parse_args()
    pythons = dict(each.split("=", 1) for each in options.python)
    short = header(("law",), SHORT, "arms")
    long = header(("law", "arm"), LONG)
    left_out = []
    with tempfile.TemporaryDirectory() as folder:
        kept = options.keep or Path(folder)
        kept.mkdir(parents=True, exist_ok=True)
        given = kept / "cases.json"
        if not given.exists():
            made = [each.as_json() for each in cases(options.robots, options.cases)]
            given.write_text(json.dumps(made), encoding="utf-8")
        for law in options.laws:
            python = pythons.get(law, sys.executable)
            name, runs = measured(law, given, python, options.old)
            if isinstance(runs, str):
                left_out.append(name)
                print(f"{name} is left out: {runs}", flush=True)
                continue
            row = short_row(name, runs, options.robots)
            print(row, end="", flush=True)
            short += row
            long += long_rows(name, runs, options.robots)
    print(long)
    note = f"\nLeft out: {', '.join(left_out)}.\n" if left_out else ""
    if tuple(options.robots) == ROBOTS and not options.dry:
        replace_section(HERE.parent / "docs" / "measurements.md", "edge", short + note)
        replace_section(RESULTS / "edge.md", "edge", long + note)


if __name__ == "__main__":
    main()
