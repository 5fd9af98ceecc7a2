"""Which page is the first answer to a word of a search.

Sphinx's search puts names of the code before the pages that explain them. The words
here are main entries of the index, which come first of all.
"""

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.transforms import SphinxTransform

WORDS: dict[str, str] = {
    "install": "install, pip, extras, container, docker, podman, conda, completion",
    "tutorial/ten_minutes": "tutorial, getting started, quick start, example",
    "how_to/add_a_task": "task, priority, priorities",
    "how_to/tune_gains": "gains, tuning, natural frequency, stiffness, damping",
    "how_to/obstacles": "obstacle, obstacle avoidance, collision, clearance, distance",
    "how_to/own_cost": "cost, own cost, own field, C++, plugin",
    "how_to/metric": "metric, weights of joints, mass matrix, dynamically consistent",
    "how_to/figures": "figures, plot, matplotlib, pdf",
    "limits": "limits, torque limits, effort limits, velocity limits, joint limits",
    "compliance": "impedance, compliance, stiffness, spring, push",
    "streams": "stream, teleoperation, policy, waypoints, target",
    "forces": "force, force control, pressing, wiping",
    "companions/mujoco": "mujoco, mjcf",
    "companions/franka": "franka, panda, fr3, real arm, hardware, gripper",
    "companions/franka_box": "libfranka, control box",
    "companions/ros2": "ros, ros 2, dds",
    "companions/simulators": "robosuite, gymnasium, reinforcement learning",
    "own_robot": "urdf, xacro, own robot, inertia, mesh",
    "companions/play": "play, interactive, teleoperation",
    "live": "live, real time, hardware, watchdog, safe stop",
    "latency": "latency, jitter, real time, deadline",
    "plants": "plant, simulation, friction, noise, delay, payload",
    "robustness": "robustness, compensation, friction, payload, observer",
    "companions/sweeps": "sweep, sensitivity, parameters",
    "trust": "security, untrusted files",
    "companions/view": "view, viewer, compare runs, meshcat, rerun, notebook, jupyter",
    "companions/export": "export, film, video, gif",
    "whole_body": "humanoid, contacts, floating base, talos, balance",
    "companions/walking": "walk, walking, trot, gait, quadruped",
    "companions/estimation": "estimation, imu, base estimation",
    "law": "law, torque, null space, singularity, projector, proof",
    "explanation/glossary": "glossary",
    "paper": "paper",
    "measurements": "benchmarks, speed, tsid, pink, comparison, fuzz",
    "reference/generated/configurations": "bundled configurations",
    "reference/generated/robots": "robots",
    "reference/generated/hsp.errors": "error, errors, error messages, exception",
    "reference/generated/yaml": "yaml, configuration file, keys",
    "reference/generated/commands": "command, command line, options",
    "development/families": "own task, extend",
}
"""Words of each page, separated by commas."""


class SearchWords(SphinxTransform):
    """Enter the words of a page into the index."""

    default_priority = 400  # before the index is collected

    def apply(self) -> None:
        """Insert the entries into the page's first section."""
        words = WORDS.get(self.env.docname)
        section = self.document.next_node(nodes.section)
        if words is None or section is None:
            return
        target = section["ids"][0]
        entries = [("single", word, target, "main", None) for word in words.split(", ")]
        section.insert(1, addnodes.index(entries=entries))


def _check(app: Sphinx) -> None:
    """Refuse words of a page that does not exist."""
    if unknown := WORDS.keys() - app.env.found_docs:
        raise ExtensionError(f"search_words.py: no page {', '.join(sorted(unknown))}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(SearchWords)
    app.connect("env-check-consistency", lambda app, _: _check(app))
    return {"parallel_read_safe": True}
