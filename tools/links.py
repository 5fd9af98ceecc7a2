"""Check the links of the documents: those to files here, and those to other sites.

    make links        or        .venv/bin/python tools/links.py [--local]

Other sites are asked over the network; ``--local`` leaves them out. Links between the
site's pages are checked when it is built (`make docs`). Prints what is broken, and
ends with 1 if anything is.
"""

import argparse
import json
import re
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPException
from pathlib import Path
from typing import NamedTuple
from urllib.error import HTTPError
from urllib.request import Request, urlopen

ROOT = Path(__file__).resolve().parents[1]
_LINK = re.compile(
    r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|<(https?://[^>\s]+)>|^\[[^\]]+\]: (\S+)",
    re.MULTILINE,
)
_PICTURE = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"")
_FENCE = re.compile(r"^(```|~~~|::::?).*?^\1|`[^`\n]+`", re.MULTILINE | re.DOTALL)
_BARE = re.compile(r"https?://[^\s\"'<>)]+")
_AGENT = {"User-Agent": "Mozilla/5.0 (hsp_control, tools/links.py)"}
_PATIENCE = 20.0  # for an answer [s]
_NOT_FOR_PROGRAMS = {401, 403, 429}  # the site is there, and wants a person


class Link(NamedTuple):
    """A link.

    Attributes:
        file: The document, relative to the checkout.
        target: What it links to: a path, with or without an anchor, or an address.
    """

    file: str
    target: str


def links(file: Path) -> Iterator[Link]:
    """Yield the links and pictures of a Markdown file, notebook or plain text."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if "outputs" not in cell]
        text = "\n\n".join("".join(cell["source"]) for cell in cells)
    elif file.suffix != ".md":
        yield from (_link(file, address) for address in _BARE.findall(text))
        return
    text = _FENCE.sub("", text)
    for found in (*_LINK.finditer(text), *_PICTURE.finditer(text)):
        yield _link(file, next(group for group in found.groups() if group))


def _link(file: Path, target: str) -> Link:
    inside = file.is_relative_to(ROOT)
    return Link(str(file.relative_to(ROOT) if inside else file), target)


def documents() -> list[Path]:
    """Return the files whose links are checked."""
    patterns = (
        "*.md",
        "*.cff",
        "pyproject.toml",
        "docs/**/*.md",
        "benchmarks/**/*.md",
        "robots/*/*.md",
        "examples/**/*.md",
        "notebooks/*.ipynb",
    )
    built = ROOT / "docs" / "_build", ROOT / "docs" / "reference" / "generated"
    found = (file for pattern in patterns for file in sorted(ROOT.glob(pattern)))
    return [
        file for file in found if not any(file.is_relative_to(each) for each in built)
    ]


def missing(found: Iterable[Link]) -> Iterator[str]:
    """Yield a line for each link to a file that is not there."""
    for link in found:
        path = link.target.partition("#")[0]
        if path and "://" not in path and not path.startswith("mailto:"):
            place = (ROOT / link.file).parent / path
            # The site's start has pages that exist only when it is built.
            if not place.exists() and "/generated/" not in path:
                yield f"{link.file}: {link.target}: there is no such file"


def unreachable(found: Iterable[Link]) -> Iterator[str]:
    """Yield a line for each address that does not answer; each is asked once."""
    where: dict[str, set[str]] = {}
    for file, target in found:
        if re.match(r"https?://", target) and not _is_private(target):
            where.setdefault(target.partition("#")[0], set()).add(file)
    with ThreadPoolExecutor(8) as pool:
        for address, problem in zip(where, pool.map(ask, where), strict=True):
            if problem:
                yield f"{', '.join(sorted(where[address]))}: {address}: {problem}"


def _is_private(address: str) -> bool:
    """Return whether an address is an example on somebody's own network."""
    return bool(
        re.match(r"https?://(localhost|127\.|10\.|172\.16\.|192\.168\.)", address)
    )


def ask(address: str) -> str:
    """Return what is wrong with an address, empty if it answers."""
    for method in ("HEAD", "GET"):  # some servers refuse the first
        request = Request(address, headers=_AGENT, method=method)
        try:
            with urlopen(request, timeout=_PATIENCE):
                return ""
        except HTTPError as error:
            problem = f"{error.code} {error.reason}"
            if error.code in _NOT_FOR_PROGRAMS:
                return ""
        except (OSError, HTTPException) as error:
            problem = str(getattr(error, "reason", error)) or type(error).__name__
    return problem


def main(arguments: list[str] | None = None) -> int:
    """Check all documents; return 1 if a link is broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--local", action="store_true", help="ask no other site")
    local = parser.parse_args(arguments).local
    found = [link for file in documents() for link in links(file)]
    broken = [*missing(found), *([] if local else unreachable(found))]
    for line in broken:
        print(line)
    print(f"{len(found)} links, {len(broken)} broken")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
