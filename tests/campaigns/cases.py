"""Statistics of the outcomes of many mutated files."""

import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from campaigns.asking import ask
from campaigns.worker import Worker
from hsp_control.common.resources import bundled_configs

KINDS = {"yaml": "campaigns.yaml_case:case", "urdf": "campaigns.urdf_case:case"}
TIMEOUT = 60.0
"""Time after which a case is a hang [s]; loaded machines are slow."""


@dataclass
class Count:
    """The outcome of many cases.

    Attributes:
        cases: Number of cases.
        kinds: Number of cases by kind: see `worker.Answer`.
        slowest: The slowest case [s], except the first of a process.
        examples: The first failures.
        seconds: Time in cases [s].
    """

    cases: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    examples: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def good(self) -> bool:
        """Whether every case ended in success or one clear error."""
        return set(self.kinds) <= {"fine", "refused"}


def warm_up() -> None:
    """Compile kernels of the cases: afterwards a case of a minute is a hang."""
    for config in bundled_configs():
        with tempfile.TemporaryDirectory() as folder:
            arguments = ["run", config, "--out", folder]
            if ask(["check", config])[0] == "fine":
                ask(arguments, stop_after=0.01)


def count_cases(
    function: str, seed: int, cases: int, show: Callable[[Count], None] | None = None
) -> Count:
    """Return the outcome of the first cases of a seed."""
    count = Count()
    with Worker(function, TIMEOUT) as worker:
        for answer in worker.answers(seed, range(cases)):
            count.cases += 1
            count.kinds[answer.kind] += 1
            count.seconds += answer.seconds
            if count.cases > 1:
                count.slowest = max(count.slowest, answer.seconds)
            if not answer.good and len(count.examples) < 20:
                text = f"case {answer.index}: {answer.kind}: {answer.text[-1500:]}"
                count.examples.append(text)
            if show is not None:
                show(count)
    return count
