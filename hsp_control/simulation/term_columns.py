"""What a log holds of the terms of a field, which may change during a run."""

from collections.abc import Iterator

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.controller import Controller
from hsp_control.geometry.scene import Obstacle
from hsp_control.null_space.fields import NullSpaceField, PointDistance
from hsp_control.null_space.fields.field import terms_of
from hsp_control.robot import RobotState
from hsp_control.simulation.log_columns import LogColumns
from hsp_control.simulation.task_columns import present_state


class TermColumns:
    """The columns of all terms of a controller's field; old ones keep theirs."""

    def __init__(self, controller: Controller, columns: LogColumns) -> None:
        self._controller, self._columns = controller, columns
        self._unit = " or ".join(dict.fromkeys(controller.robot.units)) + "/s"
        self._field: NullSpaceField | None = None
        self.update()

    def update(self) -> bool:
        """Add columns for the terms that there are; return whether they are others."""
        controller, column = self._controller, self._columns.add
        if controller.field is self._field:
            return False
        self._field, self._terms = controller.field, logged_terms(controller)
        self._distances: dict[str, NullSpaceField] = {}  # terms that measure one
        probe, nv = present_state(controller), controller.robot.nv
        for name, term in self._terms.items():
            column(f"field.{name}.g", (nv,), self._unit, "weighted share of g")
            column(f"field.{name}.value", (), "-", "unweighted cost or norm")
            if term.minimum_distance(probe) is not None:
                distance = f"distance.{name}"
                self._distances[distance] = term
                column(distance, (), "m", "minimum distance", **_center_of(term))
        return True

    def write(self, row: int, state: RobotState) -> None:
        """Write the values of the terms, and distances."""
        for name, term in self._terms.items():
            self._columns.arrays[f"field.{name}.value"][row] = term.value(state)
        for name, term in self._distances.items():
            self._columns.arrays[name][row] = term.minimum_distance(state)

    def copies(self, active: ActiveStack) -> Iterator[tuple[Array, Array]]:
        """Yield what the law writes of the terms, each with its column."""
        for name, sample in zip(self._terms, active.term_samples, strict=True):
            yield sample.g, self._columns.arrays[f"field.{name}.g"]


def logged_terms(controller: Controller) -> dict[str, NullSpaceField]:
    """Return the terms of the controller's field, by names that differ."""
    terms = terms_of(controller.field)
    names = [term.name for term in terms]
    return {
        name if names.count(name) == 1 else f"{name}_{k}": term
        for k, (name, term) in enumerate(zip(names, terms, strict=True))
    }


def _center_of(term: NullSpaceField) -> dict[str, str]:
    """Return which obstacle's centre a term's distance leads to, if to a centre."""
    if isinstance(term, PointDistance) and isinstance(term.obstacle, Obstacle):
        return {"center_of": term.obstacle.name}
    return {}
