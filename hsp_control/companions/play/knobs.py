"""Knobs, which change a setting of the controller while the robot moves.

A knob has its present value and makes the change to another one; the controller applies
or refuses it (`Controller.at`).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hsp_control.control.interface import Changes, Controller
from hsp_control.null_space.fields import NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import Ramp
from hsp_control.tasks import Gains, Impedance
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.task import SecondOrderTask

_REACH = 10.0
"""A slider goes from a tenth of a setting to ten times it, within the tolerated
range."""
_BORNE = 0.2  # largest rate times period that a slider offers; see `rate_check.RULE`


class Knob(NamedTuple):
    """One control of the page."""

    id: str  # its name among the knobs
    group: str  # its heading on the page
    label: str  # its name there
    unit: str
    value: float | bool  # its present value: a number, or whether it is on
    low: float
    high: float
    turn: Callable[[Changes, Any], object]
    note: str = ""  # its explanation

    def describe(self) -> dict[str, Any]:
        """Return its description for the page."""
        about = self._asdict()
        del about["turn"]
        kind = "switch" if isinstance(self.value, bool) else "slider"
        wide = self.low > 0.0 and self.high / self.low > 20.0
        return {**about, "kind": kind, "log": wide}

    def checked(self, value: object) -> float | bool:
        """Return a value that a page sent, within the bounds."""
        if isinstance(self.value, bool):
            if not isinstance(value, bool):
                raise ValueError(f"{self.id} must be on or off; got {value!r}")
            return value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{self.id} must be a number; got {value!r}")
        if not np.isfinite(value):
            raise ValueError(f"{self.id} is {value}; needs a finite number")
        return float(np.clip(value, self.low, self.high))


def knobs_of(controller: Controller, period: float) -> dict[str, Knob]:
    """Return the knobs of a controller, by their ids."""
    found = [*_null_space(controller, period), *_tasks(controller, period)]
    return {knob.id: knob for knob in found}


def _null_space(controller: Controller, period: float) -> Iterator[Knob]:
    field, group = controller.field, "Null space"
    if not field.controls:
        return
    switch = FieldSwitch(field)
    if switch.whole:
        note = "Off: g = 0, self-motion is only damped."
        yield Knob("field", group, "Field", "", True, 0.0, 1.0, switch.turn, note)
    K = controller.null_space_gain
    gain = float(np.diag(K).mean())
    if np.allclose(K, gain * np.eye(len(K))):
        low, high = _span(gain, period)
        note = "Rate at which self-motion converges to the field."
        id_, label = "null_space_gain", "Null-space gain K_N"
        about = Changes.null_space_gain, note
        yield Knob(id_, group, label, "1/s", gain, low, high, *about)
    for name, weight in switch.weights.items():
        if weight:
            turn, most = partial(switch.weigh, name), 5.0 * weight
            label = f"Weight of {name.replace('_', ' ')}"
            note = "The weight of this term in the sum."
            yield Knob(
                f"weight.{name}", group, label, "", weight, 0.0, most, turn, note
            )


class FieldSwitch:
    """Switches the field off (its terms stay, with weight 0) and on again."""

    def __init__(self, field: NullSpaceField) -> None:
        """Begin with the present field."""
        terms = [term for term in terms_of(field) if not isinstance(term, Rest)]
        names = [term.name for term in terms]
        self.weights: dict[str, float] = {}
        self._on = True
        for term in terms:
            weight = term.weight
            final = weight.final if isinstance(weight, Ramp) else weight
            if isinstance(final, int | float) and names.count(term.name) == 1:
                self.weights[term.name] = float(final)
        self.whole = 0 < len(self.weights) == len(terms)

    def turn(self, at: Changes, on: bool) -> None:
        """Switch the field on or off."""
        for name, weight in self.weights.items():
            at.weight(name, weight if on else 0.0)
        self._on = on

    def weigh(self, name: str, at: Changes, weight: float) -> None:
        """Change the weight of a term, or its value for when the field is on."""
        if self._on:
            at.weight(name, weight)
        self.weights[name] = weight


def _tasks(controller: Controller, period: float) -> Iterator[Knob]:
    for task in controller.tasks:
        if not isinstance(task, SecondOrderTask):
            continue
        name, impedance = task.name, impedance_of(task)
        if impedance is not None:
            low, high, turn = 1.0 / _REACH, _REACH, partial(_stiffen, name, impedance)
            id_ = f"stiffness.{name}"
            note = "Stiffness against a push, relative to that of the configuration."
            yield Knob(id_, name, "Stiffness", "×", 1.0, low, high, turn, note)
            continue
        Kp, Kv = task.gains.matrices(task.rows)
        frequency = float(np.sqrt(np.diag(Kp).mean()))
        if np.allclose(Kp, frequency**2 * np.eye(len(Kp))):
            ratio = float(np.diag(Kv).mean() / (2.0 * frequency))
            (low, high), turn = _span(frequency, period), partial(_tune, name, ratio)
            id_, label = f"frequency.{name}", "Natural frequency"
            note = "Natural frequency of its error equation."
            yield Knob(id_, name, label, "rad/s", frequency, low, high, turn, note)


def _span(rate: float, period: float) -> tuple[float, float]:
    """Return the range in which a rate [1/s] may be set."""
    return rate / _REACH, min(_REACH * rate, max(_BORNE / period, rate))


def _tune(name: str, ratio: float, at: Changes, frequency: float) -> None:
    at.gains(name, Gains(natural_frequency=frequency, damping_ratio=ratio))


def _stiffen(name: str, impedance: Impedance, at: Changes, factor: float) -> None:
    at.impedance(name, _scaled(impedance, factor))


def _scaled(impedance: Impedance, factor: float) -> Impedance:
    """Return an impedance with a multiple of the stiffness, and the same ratio."""
    damping = impedance.damping
    return replace(
        impedance,
        stiffness=factor * np.asarray(impedance.stiffness, dtype=float),
        damping=None if damping is None else np.sqrt(factor) * np.asarray(damping),
    )
