"""Values read from a text, and every message about a text that is not YAML."""

import json
import os
import re
from pathlib import Path

import pytest
from scenario_document import GOOD, message
from wording import wording

from hsp_control.common.errors import ConfigError
from hsp_control.config import yaml_reader
from hsp_control.config.document import Document
from hsp_control.config.yaml_reader import MAX_SIZE

# --- values --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-1", 0.1),
        ("1e3", 1000.0),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("+.inf", float("inf")),
        ("-.INF", -float("inf")),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("18446744073709551615", 2**64 - 1),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2001-01-01", "2001-01-01"),
        ("on", "on"),
        ("no", "no"),
        ("True", True),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ("!!str 1", "1"),
        ("!!float 1", 1.0),
        ("=", "="),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    read = Document.parse(f"key: {text}").to_dict()["key"]
    assert read == value
    assert type(read) is type(value)


def test_every_key_path_has_a_location() -> None:
    document = Document.parse(GOOD, "panda.yaml")
    assert document.location(()) == "panda.yaml:1"
    assert (
        document.location(("tasks", "hand", "trajectory", "radius")) == "panda.yaml:8"
    )
    assert document.mark(("fields", 0, "weight")) == (15, 3)
    assert document.mark(("fields", 1, "middle", "joint")) == (16, 30)
    assert document.location(("tasks", "elbow", "gains")) == "panda.yaml:11"
    # Behind an alias, the line to correct is that of its anchor.
    assert document.location(("tasks", "elbow", "gains", "kp")) == "panda.yaml:5"
    # A missing key is reported at its nearest ancestor.
    assert document.location(("tasks", "hand", "gains", "ki", 3)) == "panda.yaml:5"
    assert document.location(("nothing",)) == "panda.yaml:1"


# --- not YAML, or more than data ------------------------------------------------------


UNREADABLE = [
    ("", "1: is empty ... mapping"),
    ("\n# only this\n", "1: is empty ... mapping"),
    ("\n- 1\n- 2", "2: is [1, 2] ... mapping"),
    ("a: 1\nb:\n  c: 1\n  c: 2", "4: b.c: ... 'c' ... twice ... line 3"),
    ("a: 1\n'a': 2", "2: a: ... 'a' ... twice ... line 1"),
    ("a:\n  1: b", "2: a: a key ... 1 ... in quotes"),
    ("true: b", "1: a key ... true ... in quotes"),
    ("a: [{? [b] : c}]", "1: a.0: a key ... not a list"),
    ("a: &x {b: 1}\nc:\n  <<: *x", "3: c: merge keys ... not supported"),
    ("a:\n- !!python/object/apply:os.system ['false']",
     "2: a.0: ... '!!python/object/apply:os.system' is not allowed"),
    ("a: !gain 3", "1: a: ... '!gain' is not allowed"),
    ("a: !circle {radius: 1}", "1: a: ... '!circle' ... {type: circle, ...}"),
    ("a: !!bool on", "1: a: 'on' ... true or false"),
    ("a: 18446744073709551616", "1: a: '18446744073709551616' ... 64-bit"),
    ('a: "\\ud800"', r"1: a: '\ud800' ... text"),
    ("a: 1\n\tb: 2", "2: not YAML: a tab ... spaces"),
    ("a: b: c", "1: not YAML: a key is not allowed ... quotes"),
    ("a:\n  b: 1\n c: 2",
     "3: not YAML: the indentation does not match"),
    ("a: *b", "1: not YAML: ... undefined alias 'b'"),
    ("a: @home", "1: not YAML: ... character '@'"),
    ("a: [1,\nb: 2\n", "3: not YAML: ... from line 1 ... ']' ... '<stream end>'"),
    ("a: 1\n---\nb: 2", "2: not YAML: ... single document ... line 1"),
    ("a: 1\nb: \x07", "2: not YAML: ... U+0007"),
    ('a:\n  "\\UFFFFFFFF"', "2: not YAML: ... out of range"),
    ("a: &x [1, *x]", "1: a.1: an alias inside"),
    ("a:\n  " + "[" * 60, "2: nested deeper than 50 levels"),
    ("a: &a {b: &b {c: &c [1]}}\nd:\n  " + "".join(f"{{x{i}: "
        for i in range(48)) + "*a" + "}" * 48,
     "1: nested deeper than 50 levels"),
]  # fmt: skip


def test_json_s_pairs_are_one_character() -> None:
    """JSON escapes what is beyond U+FFFF as two surrogates, and JSON is YAML."""
    data, _ = yaml_reader.read_yaml(json.dumps({"\N{ROBOT FACE}": "\N{ROBOT FACE}"}))
    assert data == {"\N{ROBOT FACE}": "\N{ROBOT FACE}"}


@pytest.mark.parametrize(("text", "expected"), UNREADABLE)
def test_unreadable_input(text: str, expected: str) -> None:
    assert re.search(wording(f"panda.yaml:{expected}"), message(text))


def test_too_many_values_are_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_reader, "MAX_VALUES", 100)
    text = "a: [" + "1, " * 100
    assert re.search(wording("panda.yaml:1: more than 100 values"), message(text))


@pytest.mark.slow
def test_aliases_do_not_grow_without_bound() -> None:
    laughs = ["a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha, ha]"]
    laughs += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 30)]
    expected = (
        f"panda.yaml:1: more than {yaml_reader.MAX_VALUES} values (aliases expanded)"
    )
    assert message("\n".join(laughs)) == expected


def test_size_is_bounded() -> None:
    too_large = "panda.yaml: larger than 1 MB, the limit for a configuration"
    assert message("#" * (MAX_SIZE + 1)) == too_large


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("pnda.yaml", None, ": no such file; did you mean 'panda.yaml'?"),
        ("x.yaml", None, ": no such file"),
        ("folder", None, ": is a folder; give a file"),
        ("a\0b", None, ": cannot be read: embedded null byte"),
        ("latin.yaml", b"a: 1\nb: caf\xe9", ":2: not UTF-8 text (byte 0xe9)"),
        ("large.yaml", b"#" * (MAX_SIZE + 1),
         ": larger than 1 MB, the limit for a configuration"),
        ("list.yaml", b"- a",
         ":1: is ['a']; a configuration must be a mapping (key: value)"),
    ],
)  # fmt: skip
def test_files_that_cannot_be_read(
    tmp_path: Path, name: str, content: bytes | None, expected: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "panda.yaml").write_text(GOOD, encoding="utf-8")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        Document.read(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}{expected}"


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "bom.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    document = Document.read(path)
    assert document.to_dict() == {"a": 1, "b": 2}
    assert document.location(("b",)) == f"{path}:2"


def test_a_pipe_is_not_read_for_ever(tmp_path: Path) -> None:
    for name in ("made.yaml", "zero.yaml"):
        path = tmp_path / name
        if name == "zero.yaml":
            path.symlink_to("/dev/zero")
        else:
            os.mkfifo(path)
        with pytest.raises(ConfigError, match="a device or a pipe, which may never"):
            Document.read(path)
