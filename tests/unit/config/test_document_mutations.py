"""Check that any text is read or gives one ConfigError, and how names are listed."""

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scenario_document import GOOD, Scenario, read

from hsp_control.common.exceptions import ConfigError
from hsp_control.common.suggestions import did_you_mean, nearest

# --- names ---------------------------------------------------------------------------


def test_the_nearest_name_is_suggested() -> None:
    frames = ["universe", "panda_link7", "panda_hand", "panda_hand_tcp"]
    assert did_you_mean("panda_hnad", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("hand", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("UNIVERSE", frames) == "; did you mean 'universe'?"
    assert did_you_mean("xyz", frames) == ""
    assert nearest("", frames) is None
    assert nearest("a", []) is None


# --- anything else is success or one ConfigError -------------------------------------


def check(text: str, *overrides: str) -> None:
    """Validate a text; allow success, or an error that says where."""
    error = None
    try:
        read(text, *overrides)
    except ConfigError as caught:
        error = caught
    if error is not None:
        assert error.location is not None
        assert error.location.startswith(("panda.yaml:", "--set "))
        assert str(error).encode().startswith(error.location.encode())


SNIPPETS = st.one_of(
    st.text(max_size=3),
    st.sampled_from([*"\t\n:-[]{},&*!|>'\"%@`#?~.", "\n  ", "- ", "? "]),
    st.sampled_from(["&soft", "*soft", "<<: *soft", "!!int ", "!x ", "---\n", "...\n"]),
    st.sampled_from([".nan", "-.inf", "1e999", "null", "on", "'", "[[1]]", "{a: 1}"]),
    st.sampled_from(["type", "circle", "line", "kp", "-1", "9" * 400, '"\\uD800"']),
)


@st.composite
def mutated(draw: st.DrawFn) -> str:
    """Return the good text with a few stretches replaced."""
    text = GOOD
    for _ in range(draw(st.integers(1, 5))):
        start = draw(st.integers(0, len(text)))
        stop = start + draw(st.integers(0, 12))
        text = text[:start] + draw(SNIPPETS) + text[stop:]
    return text


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from(["circle"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["type", "kp", "gains", "trajectory", "line", "circle", "to"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=8,
)


@pytest.mark.slow
@given(mutated())
@settings(max_examples=400, deadline=None)
def test_mutated_texts(text: str) -> None:
    check(text)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(list(Scenario.model_fields)), PLAIN))
@settings(max_examples=200, deadline=None)
def test_mutated_data(data: dict[str, object]) -> None:
    check(yaml.safe_dump({"robot": "a", **data}))


@pytest.mark.slow
@given(
    st.sampled_from(["tasks.hand.gains.kp", "fields.0", "fields.0.type", "route", "a"]),
    PLAIN,
)
@settings(max_examples=100, deadline=None)
def test_mutated_overrides(path: str, value: object) -> None:
    check(GOOD, f"{path}={yaml.safe_dump(value, default_flow_style=True)}")
