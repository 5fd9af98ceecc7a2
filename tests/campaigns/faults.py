"""Disks that fill, logs that are cut, Ctrl-C: what was computed before is readable."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep
from hsp_control.common.exceptions import LogError
from hsp_control.simulation import Rollout

CONFIG = "paper/4_moving_obstacle"
SAVES, CUTS, INTERRUPTS = 500, 2000, 200
MOTION = {"meta", "t", "q", "v", "tau"}


@dataclass
class Faults:
    """What came of many faults.

    Attributes:
        cases: How many.
        outcomes: What came of them, in words.
        wrong: What must not have been: examples.
    """

    cases: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """Whether nothing was lost that need not be, and nothing was unclear."""
        return not self.wrong

    def add(self, outcome: str, problem: str = "") -> None:
        """Count a case."""
        self.cases += 1
        self.outcomes[outcome] += 1
        if problem and len(self.wrong) < 20:
            self.wrong.append(f"{outcome}: {problem[-1500:]}")


def same(one: Rollout, other: Rollout) -> bool:
    """Say whether the columns that both have are the same."""
    return all(
        np.array_equal(one[name], other[name], equal_nan=True)
        for name in set(one.columns) & set(other.columns)
    )


def whole_before(data: bytes, folder: Path) -> list[tuple[str, int]]:
    """Return each entry of a log's file and where it ends."""
    file = folder / "order.npz"
    file.write_bytes(data)
    with zipfile.ZipFile(file) as archive:
        entries = sorted(archive.infolist(), key=lambda entry: entry.header_offset)
        starts = [entry.header_offset for entry in entries[1:]] + [archive.start_dir]
    names = [entry.filename.removesuffix(".npy") for entry in entries]
    return list(zip(names, starts, strict=True))


# ------------------------------------------------------------------ disks that fill


def full_disk(rollout: Rollout, size: int, random: Random, folder: Path) -> Faults:
    """Save over an older log where only so many bytes fit.

    The child of a fork has the limit; /dev/full, which refuses the first byte, is
    reached through a link in the place of the half-written file.
    """
    found, path = Faults(), folder / "log.npz"
    before = Rollout({k: c[:2] for k, c in rollout.columns.items()}, rollout.meta)
    before.save(path)
    room = random.randrange(size)
    if random.random() < 0.1:
        room = 0
        (folder / ".log.npz.part").symlink_to("/dev/full")
    message = folder / "message"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads: the child only saves
        child = os.fork()
    if child == 0:
        _save_and_leave(rollout, path, room, message)
    os.waitpid(child, 0)
    said = message.read_text() if message.exists() else ""
    problem = ""
    if not said.startswith(f"{path}: cannot write the log: "):
        problem = f"said {said!r}"
    elif not same(Rollout.load(path), before) or len(Rollout.load(path)) != 2:
        problem = "the older log was damaged"
    kept = folder / "log.cut.npz"
    outcome = "nothing of the new log fits"
    if kept.exists():
        outcome = "the new log's motion is salvaged"
        salvaged = Rollout.salvage(kept)
        if not same(salvaged, rollout) or len(salvaged) != len(rollout):
            problem = "salvaged another log"
        if "hsp salvage" not in said:
            problem = f"does not say where it is: {said}"
    left = {"log.npz", "message", "log.cut.npz"}
    if {file.name for file in folder.iterdir()} - left:
        problem = f"left behind: {list(folder.iterdir())}"
    found.add(outcome, problem)
    return found


def _save_and_leave(rollout: Rollout, path: Path, room: int, message: Path) -> None:
    """Save with little room, write what was said, and end the process."""
    text = "nothing"
    with message.open("w") as file:  # opened, and small, before there is no room
        if room:
            limit = max(room, 4096)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        try:
            rollout.save(path)
        except LogError as error:
            text = str(error)
        except BaseException as error:
            text = f"raised {error!r}"
        file.write(text)
    os._exit(0)


# --------------------------------------------------------------------- cut logs


def cut_log(
    rollout: Rollout, data: bytes, ends: list[tuple[str, int]], end: int, folder: Path
) -> Faults:
    """Cut a log at a byte, and salvage it: each entry before the cut must be there."""
    found, path = Faults(), folder / "cut.npz"
    path.write_bytes(data[:end])
    whole = {name for name, stop in ends if stop <= end}
    try:
        salvaged = Rollout.salvage(path)
    except LogError as error:
        lost = "refused though the motion is whole" if whole >= MOTION else ""
        found.add("cut before the motion's end", lost and f"{lost}: {error}")
    else:
        problem = ""
        if {*salvaged.columns, "meta"} != whole:
            problem = f"at {end}: {whole ^ {*salvaged.columns, 'meta'}}"
        elif not same(salvaged, rollout):
            problem = f"at {end}: other numbers"
        found.add("salvaged", problem)
    try:
        Rollout.load(path)
    except LogError:
        pass
    else:
        if end < len(data):
            found.wrong.append(f"loaded as if whole, cut at {end} of {len(data)}")
    return found


# ------------------------------------------------------------------------- Ctrl-C


def interrupted(random: Random, folder: Path, log: Path, longest: float) -> Faults:
    """Send Ctrl-C to ``hsp`` at a random moment; what it leaves must be readable."""
    found = Faults()
    commands = {
        "long run": ["run", CONFIG, "--out", str(folder), "--set",
                     "simulation.duration=10000", "--set", "simulation.log_period=0.1"],
        "short run": ["run", CONFIG, "--out", str(folder), "--set",
                      "simulation.duration=1"],
        "check": ["check", CONFIG],
        "plot": ["plot", str(log), "--out", str(folder)],
        "export": ["export", str(log), "--html", str(folder / "page.html")],
    }  # fmt: skip
    which = random.choice([*commands, "long run", "short run"])
    process = subprocess.Popen(
        [sys.executable, "-m", "hsp_control", *commands[which]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(random.uniform(0.0, longest))
    process.send_signal(signal.SIGINT)
    try:
        _, errors = process.communicate(timeout=60.0)
    except subprocess.TimeoutExpired:
        process.kill()
        _, errors = process.communicate()
        found.add(which, f"did not end within a minute: {errors}")
        return found
    status, problem = process.returncode, ""
    outcome = {0: "done before", 130: "stopped"}.get(status, f"status {status}")
    if status == -signal.SIGINT or (
        "Traceback" in errors and "hsp_control/" not in errors.replace("-m", "")
    ):
        outcome = "stopped before Python had begun with hsp"
    elif "Traceback" in errors or "Exception ignored" in errors:
        problem = errors
    elif status not in (0, 130) or (
        status == 130 and "hsp: stopped by the" not in errors
    ):
        problem = f"status {status}: {errors}"
    for file in folder.iterdir():
        if file.name.endswith(".part"):
            problem = problem or f"left behind {file.name}"
        elif file.suffix == ".npz":
            rows = len(Rollout.load(file))
            outcome += ", log readable"
            if rows < 1:
                problem = problem or "an empty log"
    found.add(f"{which}: {outcome}", problem)
    return found


# ---------------------------------------------------------------------- all of them


def short_run(seconds: float = 1.0) -> Rollout:
    """Return a run to save, cut and plot."""
    return hsp.load_experiment(CONFIG, f"simulation.duration={seconds}").run()


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Fill disks, cut logs, press Ctrl-C."""
    rollout, good = short_run(), True
    with tempfile.TemporaryDirectory() as name:
        log = rollout.save(Path(name) / "whole.npz")
        data = log.read_bytes()
        ends = whole_before(data, Path(name))
        start = time.monotonic()
        command = ["run", CONFIG, "--out", name, "--set", "simulation.duration=1"]
        subprocess.run(
            [sys.executable, "-m", "hsp_control", *command],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        longest = 1.5 * (time.monotonic() - start)
        stages = {
            "full_disk": (SAVES, lambda r, f: full_disk(rollout, len(data), r, f)),
            "cut_log": (
                CUTS,
                lambda r, f: cut_log(rollout, data, ends, r.randrange(len(data)), f),
            ),
            "interrupts": (INTERRUPTS, lambda r, f: interrupted(r, f, log, longest)),
        }
        for stage, (full, try_once) in stages.items():
            total, wanted = Faults(), max(1, round(share * full))
            bar = progress.add_task(stage.replace("_", " "), total=wanted)
            for k in range(wanted):
                with tempfile.TemporaryDirectory() as folder:
                    one = try_once(Random(f"{stage} {seed} {k}"), Path(folder))
                total.cases += one.cases
                total.outcomes += one.outcomes
                total.wrong = [*total.wrong, *one.wrong][:20]
                progress.update(bar, completed=total.cases)
                if k % 20 == 0 or k == wanted - 1:
                    keep(stage, vars(total) | {"wanted": full, "seed": seed})
            good &= total.good
    return good
