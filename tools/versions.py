"""List the versions of the site in all of them.

    python tools/versions.py FOLDER ADDRESS

The folder contains a folder per version, and is served at the address. Its front
page opens the newest release; ``dev``, the main branch, where there is none.
"""

import json
import sys
from pathlib import Path

FRONT = '<!doctype html><meta http-equiv="refresh" content="0; url={}/index.html">\n'


def main(folder: Path, address: str) -> None:
    """Write ``versions.json`` of every version, and the front page."""
    found = {path.parent.name for path in folder.glob("*/index.html")}
    releases = sorted(
        found - {"dev"},
        key=lambda name: [int(number) for number in name.split(".")],
        reverse=True,
    )
    names = [*releases, *(found & {"dev"})]
    listed = [
        {
            "version": name,
            "url": f"{address}/{name}/",
            "preferred": name == names[0],
        }
        for name in names
    ]
    for name in names:
        (folder / name / "_static" / "versions.json").write_text(json.dumps(listed))
    (folder / "index.html").write_text(FRONT.format(names[0]))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
