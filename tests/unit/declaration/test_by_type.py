"""Parts by type: a mapping in YAML, a sequence in Python, with one outcome."""

import copy
import pickle
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import jsonschema
import pytest
from pydantic import TypeAdapter

from hsp_control.common.errors import ConfigError, ImmutableError, SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.by_type import ByType
from hsp_control.declaration.quantities import (
    READ_ONLY,
    Count,
    Number,
    ReadOnlyDict,
    Weights,
)


class Filter(Part, family="filters of a test", error=SimulationError):
    """A filter."""


class Delay(Filter, type="delay"):
    """A delay."""

    periods: Count
    """Its length [periods]."""


class Noise(Filter, type="noise"):
    """Noise."""

    std: Weights = 0.1
    """Standard deviation [rad]."""
    seed: Count = 0
    """Seed [-]."""


class Named(Filter, type="named"):
    """Numbers by name."""

    numbers: Annotated[Mapping[str, Number], READ_ONLY]
    """The numbers, by name [-]."""


class Differences(Filter, type="differences"):
    """Differences."""


class Chain(Part, error=SimulationError):
    """A chain."""

    filters: Annotated[Sequence[Filter], ByType(Filter)] = ()
    """The filters [-]."""


SAME: list[tuple[dict[str, Any], list[Filter]]] = [
    ({}, []),
    ({"delay": 2}, [Delay(2)]),
    ({"delay": {"periods": 2}}, [Delay(2)]),
    ({"delay": Delay(2)}, [Delay(2)]),
    ({"noise": True}, [Noise()]),
    ({"noise": {}}, [Noise()]),
    ({"noise": [1.0, 2.0]}, [Noise([1.0, 2.0])]),
    ({"noise": {"seed": 3}}, [Noise(seed=3)]),
    ({"noise": None, "delay": False}, []),
    ({"named": {"numbers": {"a": 1.0}}}, [Named({"a": 1.0})]),
    ({"differences": True, "noise": 0.2}, [Differences(), Noise(0.2)]),
]


@pytest.mark.parametrize(("data", "parts"), SAME)
def test_a_mapping_is_a_sequence_of_parts(
    data: dict[str, Any], parts: list[Filter]
) -> None:
    chain = Chain(filters=parts)
    made = TypeAdapter(Chain).validate_python({"filters": data})
    assert made == chain
    assert TypeAdapter(Chain).validate_python(chain.to_dict()) == chain
    assert pickle.loads(pickle.dumps(chain)) == chain
    if not any(isinstance(each, Filter) for each in data.values()):
        jsonschema.validate({"filters": data}, TypeAdapter(Chain).json_schema())
    jsonschema.validate(chain.to_dict(), TypeAdapter(Chain).json_schema())


def test_data_are_as_short_as_can_be() -> None:
    chain = Chain(filters=[Delay(2), Noise(), Differences()])
    short = {"delay": 2, "noise": True, "differences": True}
    assert chain.to_dict() == {"filters": short}
    assert Chain(filters=[Noise(seed=1)]).to_dict() == {
        "filters": {"noise": {"seed": 1}}
    }
    both = {"std": 0.2, "seed": 1}
    assert Chain(filters=[Noise(0.2, seed=1)]).to_dict() == {"filters": {"noise": both}}
    assert Chain().to_dict() == {}


WRONG: list[tuple[Any, str]] = [
    ({"dely": 1}, r"filters\.dely: unknown key 'dely'; did you mean 'delay'\?"),
    ({"delay": -1}, r"filters\.delay\.periods: -1 is negative; must be at least 0"),
    ({"delay": "x"}, r"filters\.delay\.periods: 'x' is a str; expected an int"),
    ({"delay": True}, r"filters\.delay: missing key 'periods'"),
    (
        {"noise": {"sdt": 1}},
        r"filters\.noise\.sdt: unknown key 'sdt'; did you mean 'st",
    ),
    (3, "filters: 3 is an int; expected a list of Filter"),
    ([3], "filters: 3 is not one of the filters of a test"),
    ([Delay(1), Delay(2)], "filters: two are of the type Delay; give one"),
]


@pytest.mark.parametrize(("data", "message"), WRONG)
def test_a_mistake_is_one_error_with_its_key(data: Any, message: str) -> None:
    with pytest.raises(SimulationError, match=f"^Chain: {message}"):
        Chain(filters=data)


def test_a_later_declared_member_is_included() -> None:
    assert "later" not in ByType(Filter).model.model_fields
    type("Later", (Filter,), {"__module__": __name__}, type="later")
    assert [type(f).__name__ for f in Chain(filters={"later": True}).filters] == [
        "Later"
    ]  # type: ignore[arg-type]


def test_a_read_only_mapping_refuses_every_change() -> None:
    mapping = ReadOnlyDict(a=1)
    for change in (
        lambda: mapping.__setitem__("a", 2),
        lambda: mapping.__delitem__("a"),
        lambda: mapping.update(b=2),
        lambda: mapping.__ior__({"b": 2}),
        lambda: mapping.setdefault("b", 2),
        lambda: mapping.pop("a"),
        mapping.popitem,
        mapping.clear,
    ):
        with pytest.raises(ImmutableError):
            change()
    assert mapping == {"a": 1}
    assert pickle.loads(pickle.dumps(mapping)) == mapping == copy.deepcopy(mapping)


def test_invalid_data_is_reported() -> None:
    class OnlyPython(Filter):
        """A filter without a type."""

    with pytest.raises(ConfigError, match="YAML has no name for OnlyPython"):
        Chain(filters=[OnlyPython()]).to_dict()
