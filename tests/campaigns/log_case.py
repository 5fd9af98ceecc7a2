"""One mutated log, through every command that reads logs."""

import tempfile
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from campaigns.asking import ask
from campaigns.mutate_log import mutated
from hsp_control import HspControlError, load_experiment
from hsp_control.common.exceptions import LogError
from hsp_control.simulation import Rollout
from hsp_control.visualization.viewer.recorder import Recorder
from hsp_control.visualization.viewer.replay import view_logs

CONFIGS = ("paper/4_moving_obstacle", "panda_obstacle", "limits/panda_half_strength")
RUN = ("simulation.duration=0.06", "simulation.log_period=0.01")


@cache
def log(name: str) -> bytes:
    """Return the bytes of a short run's log."""
    with tempfile.TemporaryDirectory() as folder:
        rollout = load_experiment(name, *RUN).run()
        return rollout.save(Path(folder) / "log.npz").read_bytes()


def case(seed: int, index: int) -> list[str]:
    """Return what came of case ``index``: see `worker`."""
    random = Random(f"log {seed} {index}")
    data = log(random.choice(CONFIGS))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        canary, file = folder / "canary", folder / "mutated.npz"
        file.write_bytes(mutated(data, random, str(canary)))
        answers: list[list[str]] = [_salvaged(file)]
        answers.append(ask(["plot", str(file), "--out", str(folder)]))
        page = str(folder / "page.html")
        if random.random() < 0.5:
            answers.append(_viewed(file))
        else:  # by the same way, and farther
            answers.append(ask(["export", str(file), "--html", page]))
        if random.random() < 0.3:
            answers.append(ask(["run", str(file), "--out", name], stop_after=0.3))
        if canary.exists():
            return ["unclear", "code from the log has run"]
    worst = [answer for answer in answers if answer[0] not in ("fine", "refused")]
    refused = [answer for answer in answers if answer[0] == "refused"]
    return [*worst, *refused, *answers][0]


def _salvaged(file: Path) -> list[str]:
    try:
        Rollout.salvage(file)
    except LogError:
        return ["fine", ""]  # the other answers tell
    except BaseException as error:
        return ["traceback", f"salvage: {error!r}"]
    return ["fine", ""]


def _viewed(file: Path) -> list[str]:
    """Do what ``hsp view`` does, with a recorder in the page's place."""
    import traceback

    recorder: Any = Recorder()
    try:
        with view_logs([file], transport=recorder):
            return ["fine", ""]
    except HspControlError as error:
        return ["refused", str(error)]
    except BaseException:
        return ["traceback", traceback.format_exc()]
