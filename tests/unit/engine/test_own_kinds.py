"""User-defined kinds: compiled, loaded, used, and refused where they are wrong."""

import copy
import pickle
import re
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from hsp_control import engine
from hsp_control.common.errors import EngineError
from hsp_control.engine import own_kinds
from hsp_control.engine.inspection import listing

SOURCE = """
#include <hsp/kind.hpp>

struct Doubled {
  static constexpr const char* doc = "y = 2 x.";
  hsp::In<'n'> x;
  hsp::Out<'n'> y;
  void operator()() { y = 2.0 * x; }
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<Doubled>(); }
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of libraries, shared since a build takes seconds."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def source(tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    file = tmp_path / "doubled.cpp"
    file.write_text(SOURCE)
    return file


@pytest.mark.slow
def test_a_file_is_compiled_once_and_used(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = own_kinds.load(source)
    x, y = np.arange(3.0), np.zeros(3)
    call = kinds.Doubled(x=x, y=y)
    call()
    np.testing.assert_array_equal(y, 2.0 * x)
    assert "-> y [3]" in listing(call)
    with pytest.raises(ValueError, match=r"Doubled: y has the shape \(2,\)"):
        kinds.Doubled(x=x, y=np.zeros(2))
    monkeypatch.setenv("CXX", "false")  # compiled libraries are kept
    assert own_kinds.load(source) is kinds
    source.write_text(SOURCE.replace("2.0 * x", "4.0 * x"))
    with pytest.raises(EngineError, match=r"doubled\.cpp does not compile"):
        own_kinds.load(source)


OTHERS = """
#include <hsp/kind.hpp>
#include <stdexcept>

struct Doubled {  // of another file
  static constexpr const char* doc = "y = 3 x.";
  hsp::In<'n'> x;
  hsp::Out<'n'> y;
  void operator()() { y = 3.0 * x; }
};

struct Copy {  // as one of the engine's is called
  static constexpr const char* doc = "y = 3 x.";
  hsp::In<'n'> x;
  hsp::Out<'n'> y;
  void operator()() { y = 3.0 * x; }
};

struct Memory {  // throws, and counts its instances
  static inline int alive = 0;
  Memory() { ++alive; }
  ~Memory() { --alive; }
  void prepare(const hsp::Sizes&) { throw std::length_error("too much memory"); }
};

struct Large {
  static constexpr const char* doc = "Needs more memory than there is.";
  hsp::In<'n'> x;
  Memory memory;
  void operator()() {}
};

struct Alive {
  static constexpr const char* doc = "Return how many memories there are.";
  hsp::In<1> x;
  double operator()() { return Memory::alive; }
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<Doubled, Copy, Large, Alive>(); }
"""


@pytest.fixture
def others(source: Path) -> SimpleNamespace:
    """Kinds of another file, compiled once for all tests."""
    source.write_text(OTHERS)
    return own_kinds.load(source)


@pytest.mark.slow
def test_a_call_that_cannot_be_prepared_leaves_nothing_behind(
    others: SimpleNamespace,
) -> None:
    alive = others.Alive(x=np.zeros(1))
    before = alive()  # the instance whose members were read was destroyed
    for _ in range(3):
        with pytest.raises(ValueError, match="too much memory"):
            others.Large(x=np.zeros(1))
    assert alive() == before == 0.0


@pytest.mark.slow
def test_a_library_beside_its_file_needs_no_compiler(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = source.with_suffix(".so")
    shutil.copy(own_kinds._library(source), library)  # as `build` writes it
    monkeypatch.setenv("CXX", "false")
    monkeypatch.setenv("XDG_CACHE_HOME", str(source.parent))  # which has none
    assert own_kinds.load(source) is own_kinds.load(library)


@pytest.mark.slow
def test_compile_errors_have_the_compiler_s_message(source: Path) -> None:
    """Errors in the code are reported, and a kind needs a description."""
    wrong = SOURCE.replace("2.0 * x;", "2.0 * z;").replace("doc =", "words =")
    source.write_text(wrong)
    with pytest.raises(EngineError, match="does not compile:") as raised:
        own_kinds.load(source)
    reported = str(raised.value)
    assert re.search("z.* was not declared|undeclared", reported)
    assert "a kind needs a description: static" in reported


DECLARATIONS = """
#include <hsp/kind.hpp>

struct Wrong {
  static constexpr const char* doc = "Nothing that can be bound.";
  hsp::In<200> too_long;
  hsp::In<'1'> no_letter;
  hsp::View<float, hsp::Access::In, hsp::Order::Rows, 'n'> single;
  hsp::View<int, hsp::Access::Out, hsp::Order::Rows, 'n', 3, 3> narrow;
  double* pointer;
  void operator()() {}
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<Wrong>(); }
"""


@pytest.mark.slow
def test_declarations_that_cannot_be_bound_do_not_compile(source: Path) -> None:
    """A size of 200 crashed, and an int read half of an int64."""
    source.write_text(DECLARATIONS)
    with pytest.raises(EngineError, match="does not compile:") as raised:
        own_kinds.load(source)
    reported = str(raised.value)
    # one for each sequence of sizes, and of entries
    assert reported.count("a size is a number from 1 to 64, or a letter") >= 2
    assert reported.count("entries are double, std::int64_t or bool") >= 2
    assert "a call has no pointers; declare an In, Out or InOut" in reported


@pytest.mark.slow
def test_two_kinds_of_one_name_are_refused(source: Path) -> None:
    first, second = SOURCE.split('extern "C"')
    other = first.replace("#include <hsp/kind.hpp>", "").strip()
    both = f'{first}namespace more {{ {other} }}\nextern "C"{second}'
    source.write_text(both.replace("<Doubled>", "<Doubled, more::Doubled>"))
    with pytest.raises(EngineError, match=r"doubled.*declares two kinds named Doubled"):
        own_kinds.load(source)


@pytest.mark.slow
def test_files_with_one_name_for_a_kind_do_not_get_each_others(source: Path) -> None:
    """Also a file that was edited in the meantime."""
    first = own_kinds.load(source).Doubled
    source.write_text(OTHERS)
    second = own_kinds.load(source).Doubled
    x, y = np.ones(1), np.zeros((2, 1))
    first(x=x, y=y[0])()
    second(x=x, y=y[1])()
    np.testing.assert_array_equal(y, [[2.0], [3.0]])


@pytest.mark.slow
def test_copies_and_pickles_of_calls_have_the_user_s_kind(
    others: SimpleNamespace,
) -> None:
    """A user's kind, not the engine's of the same name."""
    call = others.Copy(x=np.ones(1), y=np.zeros(1))
    for same in (
        copy.copy(call),
        copy.deepcopy(call),
        pickle.loads(pickle.dumps(call)),
    ):
        assert same.kind is call.kind
        same()
        np.testing.assert_array_equal(same.values["y"], [3.0])
    assert pickle.loads(pickle.dumps(engine.Copy)) is engine.Copy
    library = own_kinds.library_of(call.kind)
    with pytest.raises(EngineError, match="has no kind Halved"):
        own_kinds.of_library(library, "Halved")
    with pytest.raises(ValueError, match="Copy is no kind that `load` returned"):
        own_kinds.library_of(engine.Copy)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            'extern "C" const void* const* hsp_kinds_1() { return nullptr; }',
            "its function hsp_kinds_1 returns nothing",
        ),
        ("int hsp_kinds_0;", "declares no kinds: it has no function"),
    ],
)
def test_a_library_without_kinds_is_named(
    source: Path, code: str, message: str
) -> None:
    source.write_text(code)
    with pytest.raises(EngineError, match=message):
        own_kinds.load(source)


def test_zig_compiles_for_any_processor_as_the_engine_does(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "ziglang", ModuleType("ziglang"))
    reported = own_kinds.command(source, source.with_suffix(".so"))
    assert reported[:5] == [sys.executable, "-m", "ziglang", "c++", "-mcpu=baseline"]


def test_no_file_and_no_compiler(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(EngineError, match="there is no file"):
        own_kinds.load(source.with_name("nowhere.cpp"))
    source.write_text(SOURCE.replace("2.0 * x", "5.0 * x"))
    monkeypatch.setenv("CXX", "/nowhere/c++")
    with pytest.raises(EngineError, match=r"compiler does not start: .*/nowhere/c\+\+"):
        own_kinds.load(source)
    monkeypatch.delenv("CXX")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(EngineError, match="no C\\+\\+ compiler is there to compile"):
        own_kinds.load(source)
