"""Names of what a MuJoCo model contains; MuJoCo does not ask for any."""

from functools import cached_property
from typing import Any


class Names:
    """The names of the bodies, joints and sites of a model, by their numbers.

    What has no name is called by its kind and its number in the model: ``joint_3``. A
    site that is called like a body is called ``site:<name>``, so that both are frames.
    """

    def __init__(self, model: Any) -> None:
        self._model = model

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """The names of the bodies; the first is ``world``."""
        model = self._model
        return _distinct("body", [model.body(i).name for i in range(model.nbody)])

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The names of the joints."""
        model = self._model
        return _distinct("joint", [model.joint(i).name for i in range(model.njnt)])

    @cached_property
    def sites(self) -> tuple[str, ...]:
        """The names of the sites."""
        model = self._model
        own = _distinct("site", [model.site(i).name for i in range(model.nsite)])
        bodies = set(self.bodies)
        return tuple(f"site:{name}" if name in bodies else name for name in own)

    @cached_property
    def actuators(self) -> tuple[str, ...]:
        """The names of the actuators."""
        model = self._model
        count = len(model.actuator_trntype)  # nu counts controls since MuJoCo 4
        return _distinct("actuator", [model.actuator(i).name for i in range(count)])


def _distinct(kind: str, names: list[str]) -> tuple[str, ...]:
    taken = set(names)
    made = []
    for index, given in enumerate(names):
        name = given or f"{kind}_{index}"
        while not given and name in taken:
            name += "_"
        made.append(name)
    return tuple(made)
