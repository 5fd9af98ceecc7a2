"""Checks that a part is a value, for all families."""

import copy
import pickle
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hsp_control.common.errors import ImmutableError
from hsp_control.declaration import Part
from hsp_control.declaration.families import value_fields


def twins(value: Part, names: Mapping[str, Any]) -> Iterator[Part]:
    """Yield a part rebuilt from its fields, copied, pickled, and from its `repr`."""
    yield type(value)(**{f.name: getattr(value, f.name) for f in value_fields(value)})
    yield replace(value)  # type: ignore[type-var]
    yield from (copy.copy(value), copy.deepcopy(value))
    yield pickle.loads(pickle.dumps(value))
    if "<function" not in repr(value):
        yield eval(repr(value), {}, dict(names))


def assert_is_a_value(value: Part, names: Mapping[str, Any]) -> None:
    """Check equality, hash and `repr`, and that neither it nor a copy ever changes."""
    assert value != object()
    for twin in twins(value, names):
        assert type(twin) is type(value)
        assert twin == value
        assert hash(twin) == hash(value)
        assert repr(twin) == repr(value)
        for name in [field.name for field in value_fields(twin)] + ["nothing"]:
            own = getattr(twin, name, None)
            with pytest.raises(ImmutableError, match=f"{name} cannot be assigned"):
                setattr(twin, name, own)
            with pytest.raises(ImmutableError, match=f"{name} cannot be deleted"):
                delattr(twin, name)
            assert not isinstance(own, list | set)
            assert not isinstance(own, np.ndarray) or not own.flags.writeable


def assert_documented(cls: type[Part]) -> None:
    """Check that a class has a description, and each of its fields a unit."""
    assert cls.__doc__
    for field in value_fields(cls):
        text = cls.documentation[field.name]
        assert re.search(r"\[[^\]]+\]", text), f"{cls.__name__}.{field.name}: {text}"
