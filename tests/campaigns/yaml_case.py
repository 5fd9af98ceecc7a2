"""One mutated configuration, through ``hsp check`` and, if fine, ``hsp run``."""

import tempfile
from pathlib import Path
from random import Random

from campaigns.asking import ask
from campaigns.mutate_yaml import mutated, override
from hsp_control.common.resources import bundled_configs

STOP = 0.3
"""Time after which Ctrl-C ends a started run [s]."""


def case(seed: int, index: int) -> list[str]:
    """Return the outcome of case ``index``: see `worker`."""
    random = Random(f"yaml {seed} {index}")
    configs = bundled_configs()
    data = configs[random.choice(list(configs))].read_bytes()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        canary, file = folder / "canary", folder / "mutated.yaml"
        sets: list[str] = []
        if random.random() < 0.15:
            sets = ["--set=" + override(data, random)]
        else:
            data = mutated(data, random, str(canary))
        file.write_bytes(data)
        arguments = [str(file), *sets]
        answer = ask(["check", *arguments])
        if answer[0] == "fine":
            out = str(folder / "out")
            answer = ask(["run", *arguments, "--out", out], stop_after=STOP)
            if answer[1].startswith("stopped by the user"):
                answer = ["fine", answer[1]]
        if canary.exists():
            return ["unclear", "code from the configuration has run"]
    return answer
