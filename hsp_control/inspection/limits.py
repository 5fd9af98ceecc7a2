"""Limits of joints that are missing, equal or reversed."""

from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element

from hsp_control.inspection.finding import Finding

_LIMITED = {"revolute", "prismatic"}
_MOVING = {*_LIMITED, "continuous"}


def check_limits(xml: Element) -> Iterator[Finding]:
    """Yield the joints whose limits are missing, equal or reversed."""
    for joint in xml.findall("joint"):
        kind, name = joint.get("type", ""), f"joint {joint.get('name', '')!r}"
        limit = joint.find("limit")
        if kind not in _MOVING:
            continue
        if limit is None:
            if kind in _LIMITED:
                cure = "give it a <limit>"
                cure += ", or type continuous" if kind == "revolute" else ""
                yield Finding("error", "limit", name, f"{kind} without <limit>", cure)
            else:
                yield _no_maximum(name, ("effort", "velocity"))
            continue
        if kind in _LIMITED:
            yield from _of_position(name, limit)
        yield from _of_maxima(name, limit, follows=joint.find("mimic") is not None)


def _of_position(name: str, limit: Element) -> Iterator[Finding]:
    lower, upper = _number(limit, "lower"), _number(limit, "upper")
    if lower > upper:
        message = f"its lower limit {lower:g} is above its upper limit {upper:g}"
        yield Finding("error", "limit", name, message, "exchange them")
    elif lower == upper:
        message = f"lower and upper limit are both {lower:g}: taken for no limit"
        yield Finding("warning", "limit", name, message, "give lower and upper")


def _of_maxima(name: str, limit: Element, *, follows: bool) -> Iterator[Finding]:
    none = []
    for which in ("effort", "velocity"):
        value = _number(limit, which)
        if limit.get(which) is None:
            message = f"<limit> without {which}, which parsers refuse"
            yield Finding("error", "limit", name, message, f'give {which}="0" or more')
        elif value < 0.0:
            message = f"its {which} limit {value:g} is negative"
            yield Finding("error", "limit", name, message, f'give {which}="0" or more')
        elif value == 0.0 and not follows:
            none.append(which)
    if none:
        yield _no_maximum(name, none)


def _no_maximum(name: str, which: Sequence[str]) -> Finding:
    return Finding(
        "note",
        "limit",
        name,
        f"no {' and no '.join(which)} limit: none is kept",
        "give it in the URDF, or under limits: in the configuration",
    )


def _number(limit: Element, name: str) -> float:
    return float(limit.get(name, 0.0))
