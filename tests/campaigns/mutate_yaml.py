"""Configurations with careless or malicious mistakes."""

import copy
from collections.abc import Iterator
from random import Random
from typing import Any

import yaml

from campaigns.texts import TRICKS

LONG = "x" * 70_000
NUMBERS: list[Any] = [
    0, -1, 1, 2, 7, 0.0, -0.0, 0.5, -1e-3, 1e-300, 5e-324, 1e300, -1e300, 1e9,
    1e-9, 1e6,
    float("nan"), float("inf"), -float("inf"), 2**31, 2**63, -(2**63), 10**400, 100_000,
]  # fmt: skip
TEXTS: list[Any] = [
    "", " ", "nan", "inf", "1e3", "yes", "null", "0x10", "start", "home", "panda",
    "world",
    "panda_hand", "../../../../etc/passwd", "/etc/passwd", "/dev/zero", "/", ".",
    "~unknown",
    "no.urdf", "x" * 300 + ".urdf", "a\0b.urdf", "file:///etc/passwd", LONG,
    "\u202e", "é",
    "%s%n", "{0}", "[bold]x[/]", "$(id)", "`id`",
    "!!python/object/apply:os.system [id]",
]  # fmt: skip
TAGS = [
    '!!python/object/apply:os.system ["touch {canary}"]',
    '!!python/object/new:os.system ["touch {canary}"]',
    '!!python/object/apply:subprocess.check_output [["touch", "{canary}"]]',
    "!!python/name:os.system",
    "!!python/module:os",
    "!!python/object/apply:builtins.eval [\"open('{canary}', 'w')\"]",
    "!!binary aGVsbG8=",
    "!!set {{a, b}}",
    "!!omap [a: 1]",
    "!!timestamp 2001-12-14",
    "!custom {{a: 1}}",
]
"""Tags that would run code or make objects in an unsafe loader."""


def mutated(data: bytes, random: Random, canary: str) -> bytes:
    """Return a mutated configuration."""
    trick = random.random()
    if trick < 0.25:
        return random.choice(TRICKS)(data, random)
    if trick < 0.33:
        return _tagged(data.decode(), random, canary).encode()
    if trick < 0.40:
        return _expanding(data.decode(), random).encode()
    tree = yaml.safe_load(data)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        _change(tree, random)
    text = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, width=1000)
    if random.random() < 0.05:
        text = _twice(text, random)
    return text.encode("utf-8", "surrogatepass")


def override(data: bytes, random: Random) -> str:
    """Return a ``--set`` for an existing or missing key of a configuration."""
    places = list(_places(yaml.safe_load(data)))
    path = [*random.choice(places)]
    if random.random() < 0.3:
        path[random.randrange(len(path))] = random.choice(
            ("x", "0", "99", "", "a b", "-1")
        )
    key = ".".join(map(str, path))
    value = random.choice([*NUMBERS, *TEXTS, {}, [], None, True])
    text = (
        yaml.safe_dump(value, default_flow_style=True).removesuffix("\n...\n").strip()
    )
    whole = f"{key}={text}"[:100_000].replace("\0", "\\0")
    if random.random() < 0.2:
        at = random.randrange(len(whole) + 1)
        whole = whole[:at] + random.choice(("=", "'", '"', ".", "[", "\n")) + whole[at:]
    return whole


def _places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    entries: Any = ()
    if isinstance(tree, dict):
        entries = tree.items()
    elif isinstance(tree, list):
        entries = enumerate(tree)
    for key, value in entries:
        yield (*path, key)
        yield from _places(value, (*path, key))


def _at(tree: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        tree = tree[key]
    return tree


def _change(tree: Any, random: Random) -> None:
    places = list(_places(tree))
    if not places:
        return
    path = random.choice(places)
    holder, key = _at(tree, path[:-1]), path[-1]
    match random.randrange(12):
        case 0 | 1 | 2:
            holder[key] = random.choice(NUMBERS)
        case 3:
            holder[key] = random.choice(TEXTS)
        case 4:
            holder[key] = random.choice(
                ({}, [], None, True, False, [[]], {"a": 1}, [None])
            )
        case 5:
            del holder[key]
        case 6 if isinstance(holder, dict):
            name = str(key)
            holder[random.choice((name[:-1], name + "s", name.upper(), "", LONG))] = (
                holder.pop(key)
            )
        case 7 if isinstance(holder, dict):
            holder[random.choice(("nonsense", "type", "name", "file", "robot"))] = (
                random.choice((1, "mesh", "/etc/passwd", {}, []))
            )
        case 8:
            other = random.choice(places)
            theirs, name = _at(tree, other[:-1]), other[-1]
            holder[key] = copy.deepcopy(theirs[name])
        case 9:
            holder[key] = _deep(random.choice((5, 30, 60, 90)), random)
        case 10:
            count = random.choice((2, 3, 6, 7, 100, 5000, 30_000))
            old = holder[key]
            holder[key] = (
                [old] * count if isinstance(old, int | float | str) else [1.0] * count
            )
        case _:
            value = holder[key]
            if isinstance(value, int | float) and not isinstance(value, bool):
                factor = random.choice((-1, 0, 1e-6, 1e3, 1e12, 0.9, 1.1, 3))
                holder[key] = float(min(max(value, -1e300), 1e300)) * factor
            elif isinstance(value, list) and value:
                value.append(random.choice(value))
            else:
                holder[key] = [value]


def _deep(levels: int, random: Random) -> Any:
    value: Any = random.choice((1, "x", []))
    for _ in range(levels):
        value = [value] if random.random() < 0.5 else {"a": value}
    return value


def _tagged(text: str, random: Random, canary: str) -> str:
    """Put a tag before a value."""
    lines = text.split("\n")
    valued = [i for i, line in enumerate(lines) if ": " in line and "#" not in line]
    i = random.choice(valued)
    key = lines[i].partition(": ")[0]
    lines[i] = f"{key}: {random.choice(TAGS).format(canary=canary)}"
    return "\n".join(lines)


def _expanding(text: str, random: Random) -> str:
    """Add aliases that grow, contain themselves, or lead nowhere."""
    match random.randrange(6):
        case 0:
            laughs = ["a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
            for k in range(1, random.choice((3, 9, 30))):
                laughs.append(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]")
            return "\n".join([*laughs, text])
        case 1:
            return f"{text}\nx: &x [*x]\n"
        case 2:
            return f"{text}\nx: *nowhere\n"
        case 3:
            return f"<<: {{a: 1}}\n{text}"
        case 4:
            return f"{text}\nx: " + "[" * random.choice((40, 60, 5000, 90_000))
        case _:
            return f"{text}\n---\n{text}"


def _twice(text: str, random: Random) -> str:
    """Repeat a key."""
    lines = text.split("\n")
    i = random.randrange(len(lines))
    return "\n".join([*lines[: i + 1], *lines[i:]])
