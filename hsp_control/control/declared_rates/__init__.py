"""Derivatives of user code are compared with a difference, once.

The law needs them: with a wrong one e_N does not decay, or the error does not obey its
equation, and no output shows it. So where a run begins, and where a change adds
parts, the user's own code is checked, on a separate state.
"""

from hsp_control.control.declared_rates.fields import check_field, check_metric
from hsp_control.control.declared_rates.tasks import check_task
from hsp_control.control.declared_rates.trajectories import check_trajectories
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.robot import RobotState


def check_rates(
    setup: Setup, known: Setup | None, state: RobotState, places: int = 0
) -> None:
    """Check the user-defined rates of the parts of a setup.

    Args:
        setup: The parts, as functions of time.
        known: A setup whose parts were checked before; None: all are checked.
        state: Where they are compared.
        places: The number of terms of the field in the declaration, the first
            ones; those of a change follow.

    Raises:
        RateError: If a rate or a gradient is wrong, a value depends on v, or an error
            equation does not follow.
    """
    checked = set[int]() if known is None else {id(each) for each in _parts(known)}
    if known is None:
        with within("null_space", "metric"):
            check_metric(setup.metric, state)
    for k, term in enumerate(setup.terms):
        if id(term.field) not in checked:
            with within(*(("null_space", "fields", k) if k < places else ())):
                check_field(term.field, state)
                check_trajectories(term.field, state.t)
    for planned in setup.tasks:
        if id(planned.task) not in checked:
            with within(*(("tasks", planned.task.name) if known is None else ())):
                check_trajectories(planned.task, state.t)
                check_task(planned.task, state)
    for held in setup.contacts:
        if id(held.contact) not in checked:
            with within(*(("contacts", held.contact.name) if known is None else ())):
                check_trajectories(held.contact, state.t)
    for name, obstacle in setup.start.scene.items():
        if id(obstacle) not in checked:
            with within("scene", name):
                check_trajectories(obstacle, state.t)


def _parts(setup: Setup) -> list[object]:
    """Return all parts of a setup that may have rates."""
    return [
        *(each.field for each in setup.terms),
        *(each.task for each in setup.tasks),
        *(each.contact for each in setup.contacts),
        *setup.start.scene.values(),
    ]
