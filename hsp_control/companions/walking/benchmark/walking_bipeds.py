r"""Other bipeds walk by the same plan, with its defaults: how fast, and how well.

    python hsp_control/companions/walking/benchmark/walking_bipeds.py \
        [--unitree FOLDER] [part of a name]

Prints one line per robot and speed: six steps on MuJoCo at 1 kHz, and a second of
standing. Nothing is tuned: a robot has its joints slightly flexed, soles as large as
its meshes or an estimate of them, and ``plan: {type: walk, speed: ...}``. ``--unitree``
is the folder ``robots`` of github.com/unitreerobotics/unitree_ros, whose robots
example-robot-data has not.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from walking import summary

from hsp_control import load_experiment
from hsp_control.common.errors import HspControlError

SPEEDS = (0.3, 0.5, 0.7)
STEPS = 6
ROMEO_HANDS = [
    f"{side}{joint}"
    for side in "LR"
    for joint in (
        *("Hand", "Finger12", "Finger13", "Thumb1", "Thumb2", "Thumb3"),
        *(f"Finger{k}{n}" for k in (2, 3) for n in (1, 2, 3)),
    )
]


@dataclass(frozen=True)
class Biped:
    """A biped: its feet, and its knees' flexion.

    Attributes:
        robot: The robot, as in a configuration.
        feet: The frames of the left and of the right foot.
        sole: The corners of the left sole in its frame, two opposite ones: x and y of
            both, and z; the right one is its mirror image [m].
        bent: Joints of the left and of the right leg, with ``{}`` for the side [rad].
        sides: The values of ``{}``.
    """

    robot: dict[str, Any]
    feet: tuple[str, str]
    sole: tuple[float, float, float, float, float]
    bent: dict[str, float]
    sides: tuple[str, str] = ("left", "right")

    def configuration(self, speed: float) -> dict[str, Any]:
        """Return the configuration of a walk with a speed [m/s]."""
        contacts, boxes = {}, {}
        for name, frame, mirror in zip(
            ("left_foot", "right_foot"), self.feet, (1.0, -1.0), strict=True
        ):
            x0, y0, x1, y1, z = self.sole
            y0, y1 = mirror * y0, mirror * y1
            corners = [[x1, y1, z], [x1, y0, z], [x0, y0, z], [x0, y1, z]]
            contacts[name] = {"type": "surface", "frame": frame, "corners": corners}
            boxes[frame] = {
                "shape": {"type": "box", "size": [x1 - x0, abs(y1 - y0), 0.02]},
                "position": [0.5 * (x0 + x1), 0.5 * (y0 + y1), z + 0.01],
            }
        joints = {
            name.format(side): angle
            for side in self.sides
            for name, angle in self.bent.items()
        }
        return {
            "robot": self.robot,
            "start": {"joints": joints, "ground": 0},
            "contacts": contacts,
            "plan": {"type": "walk", "speed": speed, "steps": STEPS},
            "null_space": {
                "gain": 6,
                "fields": [{"type": "target_posture", "target": "start"}],
            },
            "limits": {"velocity": "none"},
            "simulation": {
                "duration": 8.5,
                "control_period": 0.001,
                "log_period": 0.01,
                "integrator": {"type": "rk4", "step": 0.001},
            },
            "plant": {"type": "mujoco", "contacts": boxes, "ground": {"friction": 0.7}},
        }


UNITREE_KNEES = {
    "{}_hip_pitch_joint": -0.3,
    "{}_knee_joint": 0.6,
    "{}_ankle_pitch_joint": -0.3,
}
ROLLS = ("left_ankle_roll_link", "right_ankle_roll_link")
BIPEDS = {
    "talos": Biped(
        {"name": "talos", "locked": dict.fromkeys(
            ("gripper_left_joint", "gripper_right_joint"), 0)},
        ("left_sole_link", "right_sole_link"),
        (-0.1, -0.06, 0.1, 0.06, 0.0),
        {},
    ),
    "g1": Biped(
        {"name": "g1"}, ROLLS, (-0.05, -0.025, 0.12, 0.025, -0.035), UNITREE_KNEES
    ),
    "alexander": Biped(
        {"name": "alexander"},
        ("LEFT_FOOT", "RIGHT_FOOT"),
        (-0.07, -0.05, 0.15, 0.05, -0.07),
        {"{}_HIP_Y": -0.3, "{}_KNEE_Y": 0.6, "{}_ANKLE_Y": -0.3},
        ("LEFT", "RIGHT"),
    ),
    "icub_reduced": Biped(
        {"name": "icub_reduced"},
        ("l_sole", "r_sole"),
        (-0.06, -0.045, 0.13, 0.045, 0.0),
        {"{}_hip_pitch": 0.35, "{}_knee": -0.7, "{}_ankle_pitch": -0.35},
        ("l", "r"),
    ),
    "romeo": Biped(
        {"name": "romeo", "mimic": False, "locked": dict.fromkeys(ROMEO_HANDS, 0)},
        ("l_sole", "r_sole"),
        (-0.07, -0.05, 0.17, 0.05, 0.0),
        {"{}HipPitch": -0.3, "{}KneePitch": 0.6, "{}AnklePitch": -0.3},
        ("L", "R"),
    ),
}  # fmt: skip


def unitree(folder: Path) -> dict[str, Biped]:
    """Return the bipeds of unitree_ros, whose soles are those of their meshes."""

    def path(name: str) -> dict[str, Any]:
        return {"name": str(folder / name), "root": "free_flyer"}

    return {
        "h1": Biped(
            path("h1_description/urdf/h1.urdf"),
            ("left_ankle_link", "right_ankle_link"),
            (-0.09, -0.015, 0.19, 0.015, -0.062),
            {"{}_hip_pitch_joint": -0.3, "{}_knee_joint": 0.6, "{}_ankle_joint": -0.3},
        ),
        "h1_2": Biped(
            path("h1_2_description/h1_2_handless.urdf"),
            ROLLS,
            (-0.085, -0.042, 0.173, 0.042, -0.045),
            UNITREE_KNEES,
        ),
        "h2": Biped(
            path("h2_description/H2.urdf"),
            ("left_ankle_pitch_link", "right_ankle_pitch_link"),
            (-0.077, -0.001, 0.157, 0.076, -0.0543),
            UNITREE_KNEES,
        ),
        "r1": Biped(
            path("r1_description/R1.urdf"),
            ROLLS,
            (-0.048, -0.034, 0.132, 0.034, -0.053),
            UNITREE_KNEES,
        ),
    }


def lines(words: list[str], bipeds: dict[str, Biped]) -> Iterator[str]:
    """Yield a line per robot and speed, until one falls."""
    for name, biped in bipeds.items():
        if words and not any(word in name for word in words):
            continue
        for speed in SPEEDS:
            try:
                run = load_experiment(biped.configuration(speed)).run()
            except HspControlError as error:
                yield f"{name:14} {speed} m/s | {error}"
                break
            yield f"{name:14} {speed} m/s | {summary(run)}"
            if run.status != "completed":
                break


def main() -> None:
    """Let the bipeds walk whose names contain one of the words, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("words", nargs="*", help="parts of names of robots")
    parser.add_argument("--unitree", type=Path, help="the folder robots of unitree_ros")
    options = parser.parse_args()
    bipeds = BIPEDS | (unitree(options.unitree) if options.unitree else {})
    for line in lines(options.words, bipeds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
