"""Full disks and Ctrl-C: earlier results remain readable."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep
from hsp_control.common.errors import LogError
from hsp_control.simulation import Rollout

CONFIG = "paper/4_moving_obstacle"
SAVES, INTERRUPTS = 500, 200


@dataclass
class Faults:
    """The outcome of many faults.

    Attributes:
        cases: Number of cases.
        outcomes: Their outcomes, in words.
        wrong: Examples of wrong ones.
    """

    cases: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """Whether no avoidable loss and no unclear message occurred."""
        return not self.wrong

    def add(self, outcome: str, problem: str = "") -> None:
        """Add a case."""
        self.cases += 1
        self.outcomes[outcome] += 1
        if problem and len(self.wrong) < 20:
            self.wrong.append(f"{outcome}: {problem[-1500:]}")


def same(one: Rollout, other: Rollout) -> bool:
    """Return whether the common columns are equal."""
    return all(
        np.array_equal(one[name], other[name], equal_nan=True)
        for name in set(one.columns) & set(other.columns)
    )


# ----------------------------------------------------------------------- full disks


def full_disk(rollout: Rollout, size: int, random: Random, folder: Path) -> Faults:
    """Save over an older log with limited disk space.

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
    reported = message.read_text() if message.exists() else ""
    problem = ""
    if not reported.startswith(f"{path}: cannot write the log: "):
        problem = f"printed {reported!r}"
    elif not same(Rollout.load(path), before) or len(Rollout.load(path)) != 2:
        problem = "the older log was damaged"
    left = {"log.npz", "message"}
    if {file.name for file in folder.iterdir()} - left:
        problem = f"left behind: {list(folder.iterdir())}"
    found.add("the older log is whole", problem)
    return found


def _save_and_leave(rollout: Rollout, path: Path, room: int, message: Path) -> None:
    """Save with limited space, write the messages, and end the process."""
    text = "nothing"
    with message.open("w") as file:  # opened, and small, before the limit
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


# ------------------------------------------------------------------------- Ctrl-C


def interrupted(random: Random, folder: Path, log: Path, longest: float) -> Faults:
    """Send Ctrl-C to ``hsp`` at a random moment; its files must be readable."""
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
        _, errors = process.communicate(timeout=200.0)
    except subprocess.TimeoutExpired:
        process.kill()
        _, errors = process.communicate()
        found.add(which, f"did not end in 200 s: {errors}")
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


# ---------------------------------------------------------------------- all faults


def short_run(seconds: float = 1.0) -> Rollout:
    """Return a run to save and plot."""
    return hsp.load_experiment(CONFIG, f"simulation.duration={seconds}").run()


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Fill disks, press Ctrl-C."""
    rollout, good = short_run(), True
    with tempfile.TemporaryDirectory() as name:
        log = rollout.save(Path(name) / "whole.npz")
        size = log.stat().st_size
        start = time.monotonic()
        command = ["run", CONFIG, "--out", name, "--set", "simulation.duration=1"]
        subprocess.run(
            [sys.executable, "-m", "hsp_control", *command],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        longest = 1.5 * (time.monotonic() - start)
        stages = {
            "full_disk": (SAVES, lambda r, f: full_disk(rollout, size, r, f)),
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
