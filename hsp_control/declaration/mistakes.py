"""One error for the wrong arguments of a part, in the words of the package."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from hsp_control.common.exceptions import HspControlError
from hsp_control.declaration.families import Declared
from hsp_control.declaration.findings import Finding, findings
from hsp_control.declaration.keys import KeyPath, written
from hsp_control.declaration.schema import shape
from hsp_control.declaration.wording import explained


def argument_error(cls: type[Declared], error: ValidationError) -> HspControlError:
    """Return the part's own error for what pydantic found wrong with its arguments."""
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    names = [field.name for field in fields if not field.kw_only]
    pending = []
    for each in error.errors(include_url=False):
        path = each["loc"]
        if not path and (own := domain_error(each)):
            return type(own)(f"{cls.__name__}: {own}")
        if path and isinstance(path[0], int):  # the position of an argument
            if path[0] >= len(names):
                plural = "" if len(names) == 1 else "s"
                taken = f"{len(names)} positional argument{plural} ({', '.join(names)})"
                return cls.error(
                    f"{cls.__name__}: takes {taken if names else 'none by position'}; "
                    f"{'the others' if names else 'arguments'} are given by name"
                )
            path = (names[path[0]], *path[1:])
        pending.append((path, each))
    found = findings(_Arguments(), shape(cls), pending)
    return as_error(found[0], cls)


def as_error(finding: Finding, cls: type[Declared]) -> HspControlError:
    """Return the error of a finding about an argument of a part."""
    where = ": ".join(part for part in (cls.__name__, written(finding.path)) if part)
    own = domain_error(finding.error)
    kind = cls.error if own is None else type(own)
    return kind(f"{where}: {explained(finding)}")


class Carrier(ValueError):
    """Carries an error that is no `ValueError` through pydantic."""

    def __init__(self, error: HspControlError) -> None:
        """Carry an error."""
        super().__init__(str(error))
        self.error = error


def domain_error(error: Mapping[str, Any]) -> HspControlError | None:
    """Return the package's own error that a check raised, if it did."""
    raised = error.get("ctx", {}).get("error")
    if isinstance(raised, Carrier):
        return raised.error
    return raised if isinstance(raised, HspControlError) else None


class _Arguments:
    """What `findings` asks about a text, for arguments that come from no text."""

    def __contains__(self, path: KeyPath) -> bool:
        return True

    def mark(self, path: KeyPath) -> None:
        """Return no line."""
