"""Masses and inertias that no body can have."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from hsp_control.inspection.finding import Finding, Severity
from hsp_control.robot.description.inertias import impossible_inertias, tensor_of
from hsp_control.robot.description.loading import NEGATIVE_MOMENT

_CURE = "project_inertias: true takes the nearest possible one, --fix writes it"


def check_inertias(xml: Element) -> Iterator[Finding]:
    """Yield the links whose inertia no body can have, and moments without a mass."""
    for found in impossible_inertias(xml):
        refused = found.moments[0] < -NEGATIVE_MOMENT
        severity: Severity = "error" if refused else "warning"
        yield Finding(severity, "inertia", f"link {found.link!r}", found.reason, _CURE)
    for link in xml.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is None or inertia is None or float(mass.get("value", 0.0)) > 0.0:
            continue
        if tensor_of(inertia).any():
            yield Finding(
                "warning",
                "inertia",
                f"link {link.get('name', '')!r}",
                "it has an inertia, but its mass is 0",
                "give it a mass",
            )
