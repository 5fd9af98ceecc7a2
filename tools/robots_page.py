"""Write docs/robots.md: every robot that is found by name, and what it can do.

.venv/bin/python tools/robots_page.py
"""

from pathlib import Path

from hsp_control.cli.robot_table import number, rows, task

PAGE = Path(__file__).resolve().parents[1] / "docs" / "robots.md"
PREFACE = """\
# Robots

The robots that `Robot.load` finds by name, as `hsp robots` prints them. Any other robot
is loaded by the path of its URDF: [your own robot](own_robot.md), or from an MJCF:
[MuJoCo](mujoco.md).

The end effector is the frame that the robot's source names; if it names none, it is the
most likely frame in the tree of joints (`Robot.end_effector`). *Position* and *pose*
give the rank of these tasks at the end effector, and how many of its joints remain
for self-motion: 3 + 4 for an arm with seven joints. Every robot with a number there is
simulated in `tests/integration/test_every_robot.py`. Robots with a floating base, which
need contacts, are simulated there with `root: fixed`.
"""
HEADINGS = (
    *("robot", "root", "nq", "nv", "end effector"),
    *("joints to it", "position", "pose", "note"),
)


def page() -> str:
    """Return the page."""
    lines = [
        *PREFACE.splitlines(),
        "",
        f"| {' | '.join(HEADINGS)} |",
        "|---|---|--:|--:|---|--:|---|---|---|",
    ]
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


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
