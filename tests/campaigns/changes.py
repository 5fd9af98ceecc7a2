"""Changes of every kind while a controller runs: past ones leave no trace.

After twenty changes of a kind (of messages, when their record is full) and after a
hundred thousand, a controller has the same representation, the same calls in a step, a
pickle of the same size, and the process the same number of Python objects; and a copy
makes the same step.
"""

import gc
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from multiprocessing import get_context

import numpy as np
import psutil
from each_change import BACK, CHANGES, controller, step
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep

NUMBER, FEW = 100_000, 20
RECORDED = 10_000
"""Messages after which a stream without a log stops recording: the reference for later
ones."""
RAMP = 2e-3
EVERY = 3  # steps between changes, so that their ramps overlap
OVER = 2000  # steps after which all changes are forgotten
PICKLE = 60  # digits of times and counters [bytes]
OBJECTS = 200
PROCESS = 8_000_000  # as in `soak` [bytes]


@dataclass(frozen=True)
class Kept:
    """The memory once all changes are over."""

    text: str
    calls: int  # length of the step's plan in text
    pickle: int  # [bytes]
    objects: int
    process: int  # resident set [bytes]
    same: bool  # a pickle and a copy make the same step, to the last bit

    def grew_from(self, few: "Kept") -> str:
        """Return the growth; empty if none."""
        grown = {
            "repr": self.text != few.text,
            "step": self.calls != few.calls,
            "pickle": abs(self.pickle - few.pickle) > PICKLE,
            "objects": self.objects - few.objects > OBJECTS,
            "process": self.process - few.process > PROCESS,
            "copy": not self.same,
        }
        return ", ".join(name for name, bad in grown.items() if bad)


class Repeated:
    """A controller with repeated changes of one kind."""

    def __init__(self, kind: str) -> None:
        self.kind, self.k = kind, 0
        pose = [hsp.FramePose(name="hand")] if kind == "twist" else []
        self.made = controller(*pose)
        self._step()

    def _step(self) -> None:
        step(self.made, self.k)
        self.k += 1

    def change(self, j: int) -> None:
        """Make the j-th change, and some steps."""
        made = self.made
        if self.kind == "target":
            made.set_target("hand", [0.5, 0.01 * (j % 7), 0.5])
        elif self.kind == "twist":
            made.set_velocity("hand", [0.0, 0.0, 0.01 * (j % 7), 0.1, 0.0, 0.0], "tool")
        else:
            back = BACK.get(self.kind)
            make = back if back and j % 2 else CHANGES[self.kind]
            make(made.at(self.k * 1e-3).ramp(RAMP))
        for _ in range(EVERY):
            self._step()

    def kept(self) -> Kept:
        """Return the memory after all changes."""
        for _ in range(3):
            self.k += OVER
            self._step()
        made = self.made
        gc.collect()
        objects, process = len(gc.get_objects()), psutil.Process().memory_info().rss
        saved = pickle.dumps(made)
        again, home = pickle.loads(saved), made.robot.home()
        at = self.k * 1e-3, home, np.zeros(made.robot.nv)
        same = again.compute(*at).tau.tobytes() == made.compute(*at).tau.tobytes()
        return Kept(
            repr(made), len(str(made.step_plan)), len(saved), objects, process, same
        )


KINDS = (*CHANGES, "target", "twist")


def grown(kind: str, number: int) -> str:
    """Make changes of a kind; return what grew, empty if nothing."""
    repeated, some = Repeated(kind), RECORDED if kind in ("target", "twist") else FEW
    for j in range(some):
        repeated.change(j)
    few = repeated.kept()
    for j in range(some, 2 * (max(number, 2 * some) // 2)):
        repeated.change(j)
    return repeated.kept().grew_from(few)


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Make all changes of each kind.

    In a process of its own: the memory that another kind has freed may be filled again.
    """
    number, found = max(2 * FEW, round(share * NUMBER)), dict[str, str]()
    bar = progress.add_task("changes", total=len(KINDS))
    fresh = get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=fresh, max_tasks_per_child=1) as processes:
        each = processes.map(grown, KINDS, repeat(number))
        for kind, grew in zip(KINDS, each, strict=True):
            found[kind] = grew
            progress.advance(bar)
            keep("changes", {"number": number, "wanted": NUMBER, "grew": found})
    return not any(found.values())
