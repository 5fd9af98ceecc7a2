"""Compile what the bundled configurations use, for a wheel: ``make wheel``.

Writes ``machine_code/`` beside the package, for a processor that all of the last ten
years contain. ``hsp_control/compiled/kernel_cache.py`` says where it is used.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from hsp_control.common.resources import bundled_configs
from hsp_control.compiled.kernel_cache import shipped_processor

FOLDER = Path(__file__).resolve().parents[1] / "machine_code"

USE = """
import sys

import hsp_control as hsp

log, *names = sys.argv[1:]
for k, name in enumerate(names):
    print(f"[{k + 1}/{len(names)}] {name}", flush=True)
    experiment = hsp.load_experiment(name, "simulation.duration=0.02")
    controller = experiment.controller
    controller.compute(0.0, experiment.q0, experiment.v0)
    controller.diagnose()
    experiment.run().save(log)
"""
"""Whatever a run of a configuration calls."""


def main() -> None:
    """Run the configurations, and gather what was compiled.

    In one process: most have their kernels from those before, and starting takes longer
    than running. It is a process of its own because Numba reads the variables once.
    """
    names = sys.argv[1:] or sorted(bundled_configs())
    with tempfile.TemporaryDirectory() as folder:
        environment = {
            **os.environ,
            "NUMBA_CACHE_DIR": folder,
            "NUMBA_CPU_NAME": shipped_processor()[0],
            "NUMBA_CPU_FEATURES": "",
        }
        python = [sys.executable, "-c", USE, f"{folder}/log.npz", *names]
        subprocess.run(python, check=True, env=environment)
        shutil.rmtree(FOLDER, ignore_errors=True)
        FOLDER.mkdir()
        for file in Path(folder).rglob("*.nb?"):
            shutil.copy(file, FOLDER)
    files = list(FOLDER.iterdir())
    size = sum(file.stat().st_size for file in files) / 1e6
    print(f"{FOLDER.name}: {len(files)} files, {size:.1f} MB")


if __name__ == "__main__":
    main()
