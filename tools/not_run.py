"""The blocks of the documents that no test runs as they stand, and why.

    .venv/bin/python tools/not_run.py

A table in Markdown, from the comments before them: see tests/support/page_runner.
Blocks that need hardware, a network or an installation are tried by hand.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "tests" / "integration")]

from page_runner import blocks_of, lines_of  # noqa: E402
from test_pages import WITH_BLOCKS  # noqa: E402


def main() -> None:
    """Print the table, ordered by reason."""
    rows = [
        (block.reason, f"{page}:{block.line}", _begin(block.text))
        for page in WITH_BLOCKS
        for block in blocks_of(page)
        if block.kind == "not run"
    ]
    print("| block | begins with | not run |\n|---|---|---|")
    for reason, where, begin in sorted(rows):
        print(f"| {where} | `{begin}` | {reason} |")
    print(f"\n{len(rows)} blocks")


def _begin(text: str) -> str:
    first = next(iter(lines_of(text)), text.splitlines()[0])
    return first.replace("|", "\\|").partition("\n")[0][:50].strip()


main()
