"""Elements of a URDF that no parser should accept: numbers, repetitions, limits."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from hsp_control.inspection.finding import Finding
from hsp_control.robot.description.urdf_checks import problems


def check_elements(xml: Element) -> Iterator[Finding]:
    """Yield what is wrong with the elements of a URDF; then the robot does not load."""
    for where, problem in problems(xml):
        yield Finding("error", "element", where, problem)
