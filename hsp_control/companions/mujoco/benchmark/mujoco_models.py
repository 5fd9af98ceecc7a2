r"""Compare robots made of MuJoCo's models with MuJoCo, for every MJCF of many packages.

    .venv/bin/python hsp_control/companions/mujoco/benchmark/mujoco_models.py \
        [--folder NAME=PATH ...]

Downloads the packages, without their dependencies, into a temporary folder; or uses
the MJCF files of a folder. Every file that MuJoCo compiles and that has a joint is made
a robot as a whole. Writes mujoco_models.csv and a section of results.md.
"""

import argparse
import csv
import logging
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
from rich.progress import track

from hsp_control import HspControlError, Robot

ROOT = Path(__file__).resolve().parents[4]
SUPPORT = Path(__file__).parents[1] / "tests" / "support"
sys.path[:0] = [str(SUPPORT), str(ROOT / "benchmarks")]
from mujoco_oracle import Differences, differences  # noqa: E402
from shared.marked_sections import replace_section  # noqa: E402

PACKAGES = (
    "brax",
    "dm_control",
    "gymnasium",
    "gymnasium-robotics",
    "metaworld",
    "mujoco-core",
    "myosuite",
    "playground",
    "robosuite",
)
STATES = 3
TOLERANCE = 1e-12
CSV = Path(__file__).with_name("mujoco_models.csv")


class Row(NamedTuple):
    """One file: how far its robot is from MuJoCo, or why there is none."""

    package: str
    file: str
    dofs: int
    found: Differences | None
    omitted: tuple[str, ...] = ()
    refused: str = ""


def main() -> None:
    """Check all packages, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", action="append", default=[], metavar="NAME=PATH")
    folders = dict(each.split("=", 1) for each in parser.parse_args().folder)
    logging.disable(logging.WARNING)
    mujoco.set_mju_user_warning(lambda *_: None)  # no log file
    rows: list[Row] = []
    counts: dict[str, tuple[str, int, int]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        for name in (*PACKAGES, *folders):
            if name in folders:
                version, folder = "", Path(folders[name])
            else:
                version, folder = downloaded(name, Path(temporary) / name)
            files = sorted(mjcf_files(folder))
            own = [
                row
                for file in track(files, name)
                for row in checked(name, folder, file)
            ]
            counts[name] = version, len(files), len(own)
            rows += own
    write_csv(rows)
    replace_section(
        Path(__file__).with_name("results.md"),
        "mujoco_models",
        "\n" + table(rows, counts),
    )
    print(f"Wrote {CSV} and results.md")


def downloaded(package: str, folder: Path) -> tuple[str, Path]:
    """Return a package's version and the folder where its files are."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
    subprocess.run([*command, "--dest", str(folder), package], check=True)
    (archive,) = folder.iterdir()
    inside = folder / "files"
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            wheel.extractall(inside)
    else:
        with tarfile.open(archive) as source:
            source.extractall(inside, filter="data")
    return archive.name.removesuffix(".tar.gz").split("-")[1], inside


def mjcf_files(folder: Path) -> Iterator[Path]:
    """Yield the XML files below a folder that begin an MJCF."""
    for file in folder.rglob("*.xml"):
        if "<mujoco" in file.read_text(encoding="utf-8", errors="replace"):
            yield file


def checked(package: str, folder: Path, file: Path) -> Iterator[Row]:
    """Yield the row of a file; none if MuJoCo does not compile it, or nothing moves."""
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError:  # a part of another file, or it lacks meshes
        return
    if model.nv == 0:
        return
    name = file.relative_to(folder).as_posix()
    try:
        robot = Robot.from_mujoco(model)
    except HspControlError as error:
        yield Row(package, name, model.nv, None, refused=str(error))
        return
    found = differences(robot, model, model.qpos0, STATES)
    yield Row(package, name, model.nv, found, robot.source.omitted)


def write_csv(rows: list[Row]) -> None:
    """Write a line per file."""
    with CSV.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["package", "file", "nv", "M", "bias", "poses", "Jacobians", "left out"]
        )
        for row in rows:
            numbers = [""] * 4 if row.found is None else numbers_of(row.found)
            notes = row.refused or "; ".join(row.omitted)
            writer.writerow([row.package, row.file, row.dofs, *numbers, notes])


def numbers_of(found: Differences) -> list[str]:
    """Return the four differences as text."""
    values = found.mass_matrix, found.bias, found.poses, found.jacobians
    return [f"{value:.1e}" for value in values]


def table(rows: list[Row], counts: dict[str, tuple[str, int, int]]) -> str:
    """Return the table by package, and the list of disagreements."""
    lines = [
        f"MuJoCo {mujoco.__version__}, {STATES} random states of each model.",
        "",
        "| package | MJCF files | compiled, with joints | most dofs | M | bias | poses "
        "| Jacobians |",
        "|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for package, (version, files, models) in counts.items():
        own = [row for row in rows if row.package == package]
        agreeing = [row.found for row in own if row.found and not disagrees(row)]
        worst = Differences(
            *(
                max((getattr(each, key) for each in agreeing), default=0.0)
                for key in ("mass_matrix", "bias", "poses", "jacobians")
            )
        )
        most = max((row.dofs for row in own), default=0)
        cells = [f"{package} {version}".strip(), files, models, most]
        lines.append(f"| {' | '.join(map(str, [*cells, *numbers_of(worst)]))} |")
    others = [row for row in rows if row.found is None or disagrees(row)]
    agreed = len(rows) - len(others)
    lines += ["", f"{agreed} of {len(rows)} models agree to {TOLERANCE:g}. The others:"]
    lines += ["", "| file | bias | why |", "|---|--:|---|"] if others else [" none."]
    for row in others:
        bias = "-" if row.found is None else f"{row.found.bias:.1e}"
        why = row.refused or "; ".join(row.omitted)
        lines.append(f"| `{row.package}`: `{row.file}` | {bias} | {why} |")
    return "\n".join(lines) + "\n\n"


def disagrees(row: Row) -> bool:
    """Return whether a robot is not MuJoCo's to rounding."""
    return row.found is not None and not row.found.largest < TOLERANCE


if __name__ == "__main__":
    main()
