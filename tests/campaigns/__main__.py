"""Run campaigns in full: ``python -m campaigns [NAME ...]`` in ``tests``, or make fuzz.

Results are stored in out/fuzz after every batch, also those of an interrupted campaign.
benchmarks/results/fuzz.md has them.
"""

import argparse
import signal
import sys
from collections.abc import Callable, Iterable
from functools import partial

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from campaigns import changes, faults, frozen, random_states, soak
from campaigns.cases import KINDS, Count, count_cases, warm_up
from campaigns.results import keep
from hsp_control.common.resources import bundled_robots

STEPS, OTHER_STEPS = 1_000_000, 20_000
CASES = {"yaml": 10_000, "urdf": 1_000}
SEED = 1989


def states(progress: Progress, seed: int, share: float) -> bool:
    """Step every bundled robot, and those of some bundled configurations."""
    good = True
    runs = [(name, STEPS, random_states.bundled) for name in bundled_robots()]
    runs += [
        (name, OTHER_STEPS, random_states.configured) for name in random_states.OTHERS
    ]
    for name, steps, drive in runs:
        wanted = max(1, round(share * steps))
        bar = progress.add_task(f"states {name}", total=wanted)
        tally = random_states.Tally()
        for k, tally in enumerate(drive(name, seed, wanted)):
            progress.update(bar, completed=tally.steps)
            if k % 10 == 0 or tally.steps == wanted:
                counts = vars(tally) | {"wanted": steps, "seed": seed}
                keep(f"states-{name.replace('/', '_')}", counts)
        good &= tally.good
    return good


def cases(progress: Progress, seed: int, share: float, kind: str) -> bool:
    """Run mutated files of one kind."""
    wanted = max(1, round(share * CASES[kind]))
    bar = progress.add_task(f"mutated {kind}", total=wanted)

    def show(count: Count) -> None:
        progress.update(bar, completed=count.cases)
        if count.cases % 20 == 0 or count.cases == wanted:
            keep(f"files-{kind}", vars(count) | {"wanted": CASES[kind], "seed": seed})

    warm_up()
    return count_cases(KINDS[kind], seed, wanted, show).good


def main(arguments: Iterable[str] | None = None) -> int:
    """Run the named campaigns, and return whether all succeeded."""
    stages: dict[str, Callable[[Progress, int, float], bool]] = {
        "states": states,
        **{kind: partial(cases, kind=kind) for kind in CASES},
        "soak": soak.campaign,
        "changes": changes.campaign,
        "faults": faults.campaign,
        "frozen": frozen.campaign,
    }
    parser = argparse.ArgumentParser(prog="campaigns", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(stages))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument(
        "--share", type=float, default=1.0, help="fraction of the cases"
    )
    options = parser.parse_args(None if arguments is None else list(arguments))
    unknown = [name for name in options.names if name not in stages]
    if unknown:
        parser.error(f"no campaign {unknown[0]!r}; there are {', '.join(stages)}")
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f}"),
        TimeRemainingColumn(),
    )
    # A shell may start this with Ctrl-C ignored, which all processes would inherit.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    good = True
    try:
        with Progress(*columns) as progress:
            for name in options.names or stages:
                good &= stages[name](progress, options.seed, options.share)
    except KeyboardInterrupt:
        print("stopped; results so far are kept", file=sys.stderr)
        good = False
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
