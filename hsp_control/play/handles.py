"""What a page can touch of a controller: targets, obstacles and settings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.exceptions import HspControlError
from hsp_control.control.controller import Controller
from hsp_control.play.grips import Grip, obstacles_of, posture_of, targets_of
from hsp_control.play.knobs import RAMP, Knob, knobs_of

KNOB_PERIOD = 0.1  # time between two changes by one knob [s]: a slider says much more


class Handles:
    """Turns what a page says into streams and changes of a controller."""

    def __init__(self, controller: Controller, period: float) -> None:
        """Find what can be touched; nothing is touched yet."""
        self._controller = controller
        self.targets: dict[str, Grip] = {
            **targets_of(controller),
            **posture_of(controller),
        }
        self.obstacles = obstacles_of(controller)
        self.knobs = knobs_of(controller, period)
        self.values: dict[str, float | bool] = {
            name: knob.value for name, knob in self.knobs.items()
        }
        self.message, self.warning = "", False
        self._turned: dict[str, float] = {}
        self._wanted: dict[str, float | bool] = {}

    def add(self, knob: Knob) -> None:
        """Add a knob."""
        self.knobs[knob.id], self.values[knob.id] = knob, knob.value

    def take(self, message: Mapping[str, Any]) -> None:
        """Do what a page says; what is wrong is answered in `message`.

        ``move`` a target or an ``obstacle``, let it ``resume`` its own path, ``set`` a
        knob. A target that is ``release``d stays where it is.
        """
        try:
            self.obey(message)
        except (HspControlError, ValueError, TypeError, OverflowError) as error:
            self.say(str(error), warning=True)

    def obey(self, message: Mapping[str, Any]) -> None:
        """Do what a page says; see `take`."""
        t = self._controller.state.t
        match message:
            case {"do": "move", "target": str(name), "pose": list(pose)}:
                _grip(self.targets, name).move(pose, t)
            case {"do": "resume", "target": str(name)}:
                _grip(self.targets, name).resume(t)
            case {"do": "obstacle", "name": str(name), "position": list(where)}:
                _grip(self.obstacles, name).move(where, t)
            case {"do": "resume", "name": str(name)}:
                _grip(self.obstacles, name).resume(t)
            case {"do": "set", "id": str(name), "value": value}:
                if name not in self.knobs:
                    raise ValueError(f"there is no knob {name!r}")
                self._wanted[name] = self.knobs[name].checked(value)
            case {"do": "release", "target": str()} | {"do": "left"}:
                pass
            case _:
                raise ValueError(f"cannot do {str(dict(message))[:200]}")

    def say(self, message: str, *, warning: bool = False) -> None:
        """Keep what there is to say."""
        self.message, self.warning = message, warning

    def turn_knobs(self) -> None:
        """Make the changes that knobs ask for; each knob's not too often."""
        t = self._controller.state.t
        for name in list(self._wanted):
            if t - self._turned.get(name, -np.inf) < KNOB_PERIOD:
                continue
            value, self._turned[name] = self._wanted.pop(name), t
            try:
                self.knobs[name].turn(self._controller.at(t).ramp(RAMP), value)
                self.values[name] = value
                self.say("")
            except HspControlError as error:
                self.say(str(error), warning=True)

    @property
    def settings(self) -> dict[str, float | bool]:
        """What the knobs are set to, or will be as soon as the time goes on."""
        return {**self.values, **self._wanted}

    def rehearse(self) -> None:
        """Ask for everything once, so that what it needs is compiled."""
        targets, obstacles = self.places()
        for name, pose in targets.items():
            self.take({"do": "move", "target": name, "pose": pose})
        for name, where in obstacles.items():
            self.take({"do": "obstacle", "name": name, "position": where})
        for name, value in self.values.items():
            off = not value if isinstance(value, bool) else value
            self.take({"do": "set", "id": name, "value": off})

    def places(self) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
        """Return where the targets and the obstacles are, by name."""
        state = self._controller.state
        return (
            {name: grip.where(state) for name, grip in self.targets.items()},
            {name: grip.where(state) for name, grip in self.obstacles.items()},
        )


def _grip(among: Mapping[str, Grip], name: str) -> Grip:
    if name not in among:
        raise ValueError(f"there is no {name!r} to drag")
    return among[name]
