"""What `make` installs with: pip's settings reach uv, or pip installs."""

import runpy

import pytest
from places import ROOT

install = runpy.run_path(str(ROOT / "tools" / "install.py"))


def uv_variables(listing: str, **environment: str) -> dict[str, str] | None:
    found: dict[str, str] | None = install["uv_variables"](
        install["pip_settings"](listing, environment)
    )
    return found


def test_without_settings_uv_is_told_nothing() -> None:
    assert uv_variables("", HOME="/root", PIP_INDEX_URL="") == {}


def test_the_index_is_passed_on() -> None:
    listing = "global.index-url='https://mirror.invalid/simple'\nglobal.timeout='60'\n"
    assert uv_variables(listing) == {
        "UV_DEFAULT_INDEX": "https://mirror.invalid/simple",
        "UV_HTTP_TIMEOUT": "60",
    }


def test_variables_override_sections_and_these_the_global_one() -> None:
    listing = ":env:.proxy='c'\ninstall.proxy='b'\nglobal.proxy='a'\nuser.proxy='d'\n"
    assert uv_variables(listing) == {"ALL_PROXY": "b"}
    assert uv_variables(listing, PIP_PROXY="c") == {"ALL_PROXY": "c"}


def test_the_best_version_of_several_indexes_is_taken_as_pip_does() -> None:
    listing = r"global.extra-index-url='\nhttps://a.invalid\nhttps://b.invalid'"
    assert uv_variables(listing, PIP_FIND_LINKS="one two") == {
        "UV_INDEX": "https://a.invalid https://b.invalid",
        "UV_INDEX_STRATEGY": "unsafe-best-match",
        "UV_FIND_LINKS": "one,two",
    }


def test_versions_are_constrained_as_the_makefile_says() -> None:
    assert uv_variables("", PIP_CONSTRAINT="c.txt", PIP_BUILD_CONSTRAINT="b.txt") == {
        "UV_CONSTRAINT": "c.txt",
        "UV_BUILD_CONSTRAINT": "b.txt",
    }


@pytest.mark.parametrize("name", ["PIP_NO_INDEX", "PIP_ONLY_BINARY", "PIP_CLIENT_CERT"])
def test_a_setting_without_equal_leaves_it_to_pip(name: str) -> None:
    assert uv_variables("", **{name: "1"}) is None


def test_what_changes_no_package_does_not_matter() -> None:
    assert uv_variables("global.no-color='true'", PIP_RETRIES="9") == {}
