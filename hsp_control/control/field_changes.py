"""Changes of the null-space field while a controller runs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Self

from pydantic import AfterValidator

from hsp_control.common.exceptions import ControllerError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.control.change import Change
from hsp_control.control.evolution import ABSENT
from hsp_control.control.setup import PlannedTerm, Setup, planned_terms
from hsp_control.declaration import within
from hsp_control.declaration.quantities import NonNegative
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import FieldSum, NullSpaceField, Rest


class ChangeField(Change, type="field"):
    """The null-space field changes to another one; Proposition 2 holds throughout."""

    fields: Annotated[Sequence[NullSpaceField], AfterValidator(tuple)]
    """The new fields; their sum is used. Without fields, self-motion comes to rest."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its fields placed."""
        placed = []
        for k, field in enumerate(self.fields):
            with within("fields", k):
                placed.append(field.placed(start))
        return replace(self, fields=placed)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the field; see `Change.apply`."""
        old = [
            PlannedTerm(each.field, each.presence.then(self.at, self.ramp, 0.0))
            for each in setup.terms
        ]
        fields = self.fields or (Rest(),)
        sum_of = fields[0] if len(fields) == 1 else FieldSum(fields)
        new = planned_terms(sum_of, ABSENT.then(self.at, self.ramp, 1.0))
        if not all(each.field.controls for each in (*old, *new)):
            raise ControllerError(
                "an uncontrolled null space cannot be blended with a controlled one"
            )
        return replace(setup, terms=(*old, *new))


class ChangeWeight(Change, type="weight"):
    """The weight of one field changes."""

    field: str
    """Name of the field."""
    weight: NonNegative
    """The new weight [-]."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the weight; see `Change.apply`."""
        k = _find_field(setup, self.field)
        # The old weight fades out, and the same field fades in with the new weight:
        # so weights that are ramps or functions of the state work alike.
        new = replace(setup.terms[k].field, weight=self.weight)
        return _with_field(setup, k, new, self)


class ExchangeField(Change, type="exchange_field"):
    """One field is replaced by another one, which keeps its weight; the others stay."""

    field: str
    """Name of the field that goes."""
    by: NullSpaceField
    """The field that comes; its own weight does not count."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its field placed."""
        with within("by"):
            return replace(self, by=self.by.placed(start))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the other field; see `Change.apply`."""
        k = _find_field(setup, self.field)
        if not self.by.controls:
            raise ControllerError("an uncontrolled null space replaces no other field")
        new = replace(self.by, weight=setup.terms[k].field.weight)
        return _with_field(setup, k, new, self)


def _find_field(setup: Setup, name: str) -> int:
    """Return the index of the term that has a name and is to stay."""
    there = {
        each.field.name: k
        for k, each in enumerate(setup.terms)
        if each.presence.target > 0.0
    }
    if name not in there:
        raise ControllerError(
            f"there is no field {name!r}{did_you_mean(name, there)} "
            f"(there are {listing(there) or 'none'})"
        )
    return there[name]


def _with_field(setup: Setup, index: int, new: NullSpaceField, change: Change) -> Setup:
    """Return the setup in which a term fades out while another one fades in."""
    terms, at, ramp = list(setup.terms), change.at, change.ramp
    old = terms[index]
    terms[index] = PlannedTerm(old.field, old.presence.then(at, ramp, 0.0))
    terms.append(PlannedTerm(new, ABSENT.then(at, ramp, 1.0)))
    return replace(setup, terms=tuple(terms))
