"""How much of the house a step runs: functions, classes and files, from a trace.

    .venv/bin/python tools/functions_of_a_step.py [--names] [--write]

Of a Panda's position task with joint centering: the first step, which places the parts
and binds the calls, and a later one. The engine's computation is one call. Then the
classes whose objects hold a gain, Kp or K_N, after a step. ``--write`` writes the
numbers, and every class on the way, into the page on the architecture.
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isclose
from pathlib import Path
from types import FrameType, MethodType, ModuleType
from typing import Any

import numpy as np

import hsp_control as hsp

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from shared.marked_sections import replace_section  # of the benchmarks

HOUSE = str(Path(hsp.__file__).parent)
PAGE = Path(__file__).parents[1] / "docs/development/architecture.md"
LATER = 400  # the unit of times is looked at in the first 300 steps
KP, GAIN = 101.234567, 7.654321  # numbers that nothing else has [1/s², 1/s]


def traced(act: Callable[[], object]) -> tuple[set[tuple[str, str]], list[type]]:
    """Return the functions, with their files, and the classes of an act, in order."""
    functions, classes = set[tuple[str, str]](), dict[type, None]()

    def look(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(HOUSE):
            return
        if code.co_name.startswith("<"):  # modules, comprehensions
            return
        functions.add((code.co_filename.removeprefix(HOUSE), code.co_qualname))
        if "self" in frame.f_locals:
            classes.setdefault(type(frame.f_locals["self"]))

    sys.setprofile(look)
    try:
        act()
    finally:
        sys.setprofile(None)
    return functions, list(classes)


def holders(root: object, number: float) -> list[str]:
    """Return the house's classes whose objects hold a number, alone or in an array."""
    seen, found, todo = {id(root): root}, set[str](), [root]
    while todo:
        here = todo.pop()
        if isinstance(here, np.ndarray | str | bytes | type | ModuleType):
            continue
        held = [*_parts(here)]
        if any(_is_or_has(each, number) for each in held) and _of_house(type(here)):
            found.add(type(here).__name__)
        for each in held:
            if id(each) not in seen:
                seen[id(each)] = each
                todo.append(each)
    return sorted(found)


def _parts(of: object) -> Iterator[object]:
    if isinstance(of, Mapping):
        yield from of.values()
    elif isinstance(of, tuple | list | set | frozenset):
        yield from of
    elif isinstance(of, MethodType):
        yield of.__self__
    elif _of_house(type(of)):
        yield from getattr(of, "__dict__", {}).values()
        values = getattr(of, "values", None)  # of a call of the engine
        if isinstance(values, Mapping):
            yield values


def _of_house(kind: type) -> bool:
    return kind.__module__.startswith("hsp_control")


def _is_or_has(value: object, number: float) -> bool:
    if isinstance(value, np.ndarray) and value.dtype == float:
        return bool(np.isclose(value, number, rtol=1e-12, atol=0.0).any())
    return isinstance(value, float) and isclose(value, number, rel_tol=1e-12)


def main() -> None:
    """Print the numbers, and with ``--names`` the functions of a later step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--names", action="store_true", help="list the functions")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    options = parser.parse_args()
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition(name="hand", gains=hsp.Gains(kp=KP, kv=20.0))
    controller = hsp.Controller(
        robot, [hand], hsp.JointCentering(), null_space_gain=GAIN
    )
    q, v = robot.home(), np.zeros(robot.nv)
    counts, on_the_way = list[int](), list[type]()
    for k, name in ((0, "first step"), (LATER, "later step")):
        for earlier in range(1, k):
            controller.compute(0.001 * earlier, q, v)
        functions, classes = traced(lambda k=k: controller.compute(0.001 * k, q, v))
        files = {file for file, _ in functions}
        counts += [len(functions), len(classes), len(files)]
        on_the_way = on_the_way or classes
        print(
            f"{name}: {len(functions)} functions, {len(classes)} classes, "
            f"{len(files)} files"
        )
        if options.names:
            for file, function in sorted(functions):
                print(f"  {file}: {function}")
    held = [holders(controller, number) for number in (KP, GAIN)]
    for name, classes_of in zip(("Kp", "K_N"), held, strict=True):
        print(f"{name} is held by {len(classes_of)} classes: {', '.join(classes_of)}")
    if options.write:
        PAGE.write_text(written(PAGE.read_text("utf-8"), counts, held), "utf-8")
        replace_section(PAGE, Path(__file__).name, table(on_the_way))


def table(classes: Sequence[type]) -> str:
    """Return a table of classes: module, name, and the docstring's first line."""
    lines = ["| module | class | what it is |", "|---|---|---|"]
    for kind in classes:
        module = kind.__module__.removeprefix("hsp_control.")
        what = (kind.__doc__ or "").partition("\n")[0].replace("|", "\\|")
        lines.append(f"| `{module}` | `{kind.__name__}` | {what} |")
    return "\n".join(lines) + "\n"


def written(page: str, counts: Sequence[int], held: Sequence[Sequence[str]]) -> str:
    """Return the page with other numbers and names, in their order."""
    for pattern, values in (
        (r"\d+(?=\s+(?:functions of|classes in|files (?:the|later)))", counts),
        (r"\d+\s+classes\s+\([\w,\s]+\)", [_listed(each) for each in held]),
    ):
        following = iter(map(str, values))
        page = re.sub(pattern, lambda _, one=following: next(one), page)  # type: ignore[misc]
    return page


def _listed(names: Sequence[str]) -> str:
    return f"{len(names)} classes ({', '.join(names)})"


if __name__ == "__main__":
    main()
