"""``hsp inspect``: reports implausible values in a robot's description."""

import argparse
import json
import logging
import os
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from xml.etree import ElementTree

from hsp_control.cli.consoles import out, working
from hsp_control.cli.loading import robot_access, run_imports
from hsp_control.common.errors import ModelError
from hsp_control.companions.inspection.findings import Inspection
from hsp_control.companions.inspection.findings import inspect as inspect_robot
from hsp_control.robot import RobotDescription
from hsp_control.robot.description.access import XmlError, read_xml
from hsp_control.robot.description.inertias import project_inertias
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf import read_urdf

_WIDTH = 80
_SHOWN = 12
"""Maximum number of elements listed for one finding."""


def inspect(options: argparse.Namespace) -> int:
    """Print the findings about a robot; return 2 if it does not load."""
    run_imports(options)
    arguments, access = _arguments(options.args), robot_access(options.robot, options)
    given = "mjcf" if _is_mjcf(Path(options.robot)) else "name"
    description = RobotDescription(**{given: options.robot}, xacro_args=arguments)
    with _no_warnings(), working(f"Inspecting {options.robot}"):
        inspection = inspect_robot(description, access)
    if options.json:
        print(json.dumps(inspection.to_dict(), indent=2, ensure_ascii=False))
    else:
        for line in report(inspection):
            out.print(line, markup=False)
    if options.fix is not None:
        file = write_repaired(inspection.source, options.fix)
        if not options.json:
            out.print(f"Written with projected inertias: {file}", markup=False)
    return 0 if inspection.loads else 2


def write_repaired(source: RobotSource, path: Path) -> Path:
    """Write a robot's URDF with projected inertias; only comments are lost."""
    xml = read_urdf(source)
    if path.exists() and path.samefile(source.urdf):
        raise ModelError(f"{path}: is the robot's own file; give another one")
    project_inertias(xml)
    for element in xml.iter():
        name = element.get("filename")
        if name is not None and "://" not in name and not Path(name).is_absolute():
            file = source.urdf.resolve().parent / name
            element.set("filename", os.path.relpath(file, path.resolve().parent))
    ElementTree.ElementTree(xml).write(path, encoding="utf-8", xml_declaration=True)
    return path


def report(inspection: Inspection) -> Iterator[str]:
    """Yield the lines that are printed, of at most 80 characters."""
    for name, text in inspection.facts.items():
        line = f"{name:12}  {text}"
        yield from [line] if name == "file" else _wrapped(line, "", " " * 14)
    for (severity, check, cure), findings in inspection.groups().items():
        yield ""
        yield f"{severity}: {check}"
        for finding in findings[:_SHOWN]:
            yield from _wrapped(f"{finding.element}: {finding.message}", "  ", "    ")
        if len(findings) > _SHOWN:
            yield f"  ... {len(findings)} in all; --json lists them"
        if cure:
            yield from _wrapped(cure, "  -> ", "     ")
    yield ""
    counts = {
        severity: sum(f.severity == severity for f in inspection.findings)
        for severity in ("error", "warning", "note")
    }
    yield ", ".join(f"{n} {s}{'s' * (n != 1)}" for s, n in counts.items())


def _is_mjcf(path: Path) -> bool:
    """Return whether a file is an MJCF: both kinds of file may end in .xml."""
    with suppress(OSError, ValueError, XmlError):  # of a robot by name; reported later
        return path.suffix == ".xml" and read_xml(path).tag == "mujoco"
    return False


@contextmanager
def _no_warnings() -> Iterator[None]:
    """Keep the package's warnings from being printed: they are findings here."""
    logger = logging.getLogger("hsp_control")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _wrapped(text: str, first: str, rest: str) -> list[str]:
    return textwrap.wrap(
        text,
        _WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_on_hyphens=False,
        break_long_words=False,
    )


def _arguments(texts: list[str]) -> dict[str, str]:
    """Return the arguments of a xacro file."""
    arguments = {}
    for text in texts:
        name, separator, value = text.partition(":=")
        if not (name and separator):
            raise ModelError(f"{text!r}: an argument of a xacro file is name:=value")
        arguments[name] = value
    return arguments
