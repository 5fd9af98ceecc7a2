"""Run every bundled configuration, and compare each column of its log bit by bit.

    .venv/bin/python tools/compare_runs.py keep FOLDER [CONFIG ...]
    .venv/bin/python tools/compare_runs.py with FOLDER [CONFIG ...]

``keep`` writes the logs as a reference, outside of the tree. ``with`` runs the
configurations again and names each column that differs, from which time on and by how
much at most, and those that are missing; it exits 1 if there are any.
A difference is no error by itself: a change of digits needs a reason in its commit.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.resources import bundled_configs

CLOCKS = ("_time",)
"""Ends of the names of columns that contain times of the machine's own clock."""


def columns_of(path: Path) -> dict[str, Array]:
    """Return the numeric columns of a log, without measured times."""
    with np.load(path, allow_pickle=False) as log:
        arrays = {name: log[name] for name in log.files}
    return {
        name: array
        for name, array in arrays.items()
        if array.dtype.kind in "fiub" and not name.endswith(CLOCKS)
    }


def differences(kept: dict[str, Array], now: dict[str, Array]) -> list[str]:
    """Return a line per column that is not the same, or that is missing.

    Columns that are new are no difference.
    """
    t, lines = kept["t"], []
    for name, old in sorted(kept.items()):
        new = now.get(name)
        if new is None:
            lines.append(f"{name}: missing")
            continue
        if old.shape != new.shape:
            lines.append(f"{name}: shape {old.shape}, now {new.shape}")
        elif not np.array_equal(old, new, equal_nan=old.dtype.kind == "f"):
            off = np.abs(new.astype(float) - old.astype(float))
            rows = off.reshape(len(off), -1).max(axis=1, initial=0.0)
            first = t[np.argmax(~(rows == 0.0))] if len(rows) == len(t) else np.nan
            lines.append(
                f"{name}: from t = {first:g}, by at most "
                f"{np.nanmax(rows, initial=0.0):.3g}"
            )
    return lines


def main() -> int:
    """Keep the logs, or compare with them; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("keep", "with"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("configs", nargs="*")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    status = 0
    for name in given.configs or sorted(bundled_configs()):
        kept = given.folder / f"{name.replace('/', '-')}.npz"
        try:
            rollout = hsp.load_experiment(name).run()
        except hsp.HspControlError as error:
            print(f"{name}: {error}", flush=True)
            status = 1
            continue
        if given.what == "keep":
            rollout.save(kept)
            print(f"{name}: kept", flush=True)
            continue
        fresh = kept.with_suffix(".now.npz")
        rollout.save(fresh)
        found = differences(columns_of(kept), columns_of(fresh))
        fresh.unlink()
        status = status or bool(found)
        print(f"{name}: {'differs' if found else 'the same'}", flush=True)
        for line in found:
            print(f"    {line}", flush=True)
    return int(status)


if __name__ == "__main__":
    sys.exit(main())
