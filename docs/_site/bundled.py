"""The pages of bundled configurations and robots."""

import yaml
from prose import paragraphs, plain

from hsp_control.cli.robot_table import number, rows, task
from hsp_control.common.resources import bundled_configs

ROBOTS = """\
# Robots

The robots that `Robot.load` finds by name, as `hsp robots` prints them. Others are
loaded by the path of their URDF or MJCF: [your own robot](../../own_robot.md).

*Position* and *pose* are the ranks of these tasks at the end effector, and how many
joints remain for self-motion: 3 + 4 for an arm with seven joints.

| robot | root | nq | nv | end effector | joints | position | pose | note |
|---|---|--:|--:|---|--:|---|---|---|"""


def configurations_page() -> str:
    """Return the page of the bundled configurations, by their titles and texts."""
    lines = [
        "# Configurations",
        "",
        "They are files in `configs/`, or in a companion's folder, and run by name.",
        "",
    ]
    for name, file in bundled_configs().items():
        about = yaml.safe_load(file.read_text(encoding="utf-8"))
        lines += [f"(configuration-{name.replace('/', '-')})=", f"## `{name}`", ""]
        lines += [f"**{plain(about['title'])}**", ""]
        lines += [paragraphs(about.get("description", "").strip()), ""]
    return "\n".join(lines)


def robots_page() -> str:
    """Return the page of the robots that `Robot.load` finds by name."""
    lines = [ROBOTS]
    for row in rows():
        cells = (
            row.name + (" (bundled)" if row.origin == "bundled" else ""),
            *(row.root.replace("_", "-"), number(row.nq), number(row.nv)),
            f"`{row.end_effector}`" if row.end_effector else "-",
            number(row.joints or None),
            *(task(row, row.position, 3), task(row, row.pose, 6), row.note),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
