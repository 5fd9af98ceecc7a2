"""Type names of the engine are unique across its files."""

import re
from collections import defaultdict

from places import ROOT

TYPE = re.compile(r"^(?:template <.*> )?(?:struct|class) (\w+) (?:: .*)?\{", re.M)


def test_no_two_types_have_one_name() -> None:
    """The linker would merge templates of equally named types (an ODR violation)."""
    found = defaultdict(list)
    folder = ROOT / "engine"
    for path in sorted(folder.rglob("*.hpp")):
        if "ruckig" not in path.parts:
            for name in TYPE.findall(path.read_text(encoding="utf-8")):
                found[name].append(str(path.relative_to(folder)))
    assert len(found) > 150
    assert not {name: files for name, files in found.items() if len(files) > 1}
