"""The base class of estimators of quantities that are not measured."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.entry_points import own_names
from hsp_control.common.errors import EstimationError
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import Inertial, LogChannel, Measurement
from hsp_control.declaration import Part, within
from hsp_control.declaration.by_type import ByType


class Estimator(Part, ABC, family="estimators", error=EstimationError):
    """Completes or replaces a part of the measurements.

    It acts between the sensors, and the plan and the controller. A subclass declares
    its parameters as fields (see `Part`) and implements `begin`; the memory of a
    run belongs to its result. Several run in the order of their stages.

    Attributes:
        stage: The place in the chain: `BaseEstimator` 10, `ContactForces` 20.
    """

    stage: ClassVar[float] = 100.0

    @abstractmethod
    def begin(
        self, controller: Controller, inertial: Inertial | None
    ) -> "RunningEstimator":
        """Return the estimator of one run.

        Args:
            controller: The controller, whose contacts support the robot.
            inertial: A reading of the robot's inertial measurement unit, which
                gives its placement; None: there is no unit.

        Raises:
            EstimationError: If it does not fit the robot, or an input is missing.
            FrameNotFoundError: If the robot has no such frame.
        """


class RunningEstimator(ABC):
    """An `Estimator` in one run."""

    @abstractmethod
    def update(self, measured: Measurement) -> Measurement:
        """Return the measurement with the estimates; once a period, in order.

        Raises:
            EstimationError: If an input was not measured.
        """

    @abstractmethod
    def log_channels(self, q: Array, v: Array) -> Mapping[str, LogChannel]:
        """Return the logged values of the last update, by name: ``estimate.<...>``.

        Args:
            q: The true configuration at that time, shape (nq,), for errors.
            v: The true velocity, shape (nv,).
        """


def begun(
    estimators: Sequence[Estimator], controller: Controller, inertial: Inertial | None
) -> list[RunningEstimator]:
    """Return the running estimators, in order; see `Estimator.begin`."""
    running = []
    for each in estimators:
        with within("estimators", each.yaml_type or type(each).__name__):
            running.append(each.begin(controller, inertial))
    return running


def _in_order(estimators: tuple[Estimator, ...]) -> tuple[Estimator, ...]:
    return tuple(sorted(estimators, key=lambda each: each.stage))


Estimators = Annotated[
    Sequence[Estimator], ByType(Estimator), AfterValidator(_in_order)
]
"""A chain: a sequence in Python, a mapping by type in YAML; stored by stage."""


__dir__ = own_names(__name__)
