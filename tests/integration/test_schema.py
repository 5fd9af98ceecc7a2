"""The schema for editors, with the companions' types."""

import json

from exported_schema import exported_schema

from hsp_control.common.resources import bundled, bundled_configs


def test_the_bundled_schema_is_the_exported_one() -> None:
    """Editors find it by the first line of a bundled configuration."""
    file = bundled("configs") / "hsp_control.schema.json"
    assert json.loads(file.read_text(encoding="utf-8")) == exported_schema(), (
        "refresh it with: hsp schema > configs/hsp_control.schema.json"
    )
    for path in bundled_configs().values():
        first = path.read_text(encoding="utf-8").splitlines()[0]
        where = first.removeprefix("# yaml-language-server: $schema=")
        assert (path.parent / where).samefile(file), path
