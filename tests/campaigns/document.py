"""docs/fuzz.md: the counts, as far as they went."""

from collections import Counter
from pathlib import Path
from typing import Any

from campaigns.results import kept

FILE = Path(__file__).resolve().parents[2] / "docs" / "fuzz.md"
BEGIN, END = "<!-- counts: begin -->", "<!-- counts: end -->"


def write() -> None:
    """Put the counts that are kept into the document."""
    text = FILE.read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    tail = rest.partition(END)[2]
    FILE.write_text(f"{head}{BEGIN}\n\n{counts(kept())}\n{END}{tail}", encoding="utf-8")


def counts(found: dict[str, dict[str, Any]]) -> str:
    """Return the tables."""
    parts = [_states(found), _files(found), _faults(found), _soak(found)]
    return "\n".join(part for part in parts if part)


def _number(value: float) -> str:
    return f"{value:,.0f}".replace(",", " ")


def _of(done: int, wanted: int) -> str:
    """Return a count, and of how many if the campaign was not finished."""
    return _number(done) if done >= wanted else f"{_number(done)} of {_number(wanted)}"


def _states(found: dict[str, dict[str, Any]]) -> str:
    rows = [
        "| robot, or configuration | steps | with limited efforts | near a "
        "singularity | "
        "not finite | beyond a limit | refused | largest part of an effort's limit |",
        "|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for name, c in found.items():
        if name.startswith("states-"):
            refused = sum(c["raised"].values())
            rows.append(
                f"| `{name.removeprefix('states-')}` | "
                f"{_of(c['steps'], c['wanted'])} | "
                f"{_number(c['limited'])} | {_number(c['damped'])} | "
                f"{c['not_finite']} | "
                f"{c['beyond']} | {refused} | {c['worst']:.9g} |"
            )
    return "\n".join([*rows, ""]) if len(rows) > 2 else ""


def _files(found: dict[str, dict[str, Any]]) -> str:
    rows = [
        "| mutated | cases | success | one clear error | tracebacks | unclear | "
        "crashes | hangs | slowest [s] |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    names = {"yaml": "configurations", "urdf": "URDFs and meshes"}
    for kind, name in names.items():
        c = found.get(f"files-{kind}")
        if c is not None:
            kinds = Counter(c["kinds"])
            told = ("fine", "refused", "traceback", "unclear", "crash", "hang")
            each = " | ".join(_number(kinds[what]) for what in told)
            cases = _of(c["cases"], c["wanted"])
            rows.append(f"| {name} | {cases} | {each} | {c['slowest']:.1f} |")
    return "\n".join([*rows, ""]) if len(rows) > 2 else ""


def _faults(found: dict[str, dict[str, Any]]) -> str:
    rows = ["| fault | cases | result | wrong |", "|---|--:|---|--:|"]
    names = {
        "full_disk": "a disk that fills while a log is saved over another",
        "interrupts": "Ctrl-C at a random moment",
    }
    for stage, name in names.items():
        c = found.get(stage)
        if c is not None:
            outcomes = ", ".join(f"{k}: {n}" for k, n in sorted(c["outcomes"].items()))
            cases = _of(c["cases"], c["wanted"])
            rows.append(f"| {name} | {cases} | {outcomes} | {len(c['wrong'])} |")
    return "\n".join([*rows, ""]) if len(rows) > 2 else ""


def _soak(found: dict[str, dict[str, Any]]) -> str:
    c = found.get("soak")
    if c is None:
        return ""
    python, process = (c[of][-1] - c[of][0] for of in ("python", "process"))
    return (
        f"Soak: {_of(c['steps'], c['wanted'])} steps of 1 ms. After the warm-up "
        "Python's "
        f"own memory grew by {python / 1e3:.1f} kB, the process by "
        f"{process / 1e6:.2f} MB; the largest component of the task's error after the "
        f"first second was {c['worst_error']:.2g}.\n"
    )


if __name__ == "__main__":
    write()
