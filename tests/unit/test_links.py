"""`make links`: what it finds in a document, and what it says of an address."""

import runpy
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from places import ROOT

tool = runpy.run_path(str(ROOT / "tools" / "links.py"))

ANSWERS = {"/page": 200, "/moved": 301, "/gone": 404, "/for-persons": 403, "/post": 200}


class Site(BaseHTTPRequestHandler):
    """A site with a page of each kind."""

    def do_HEAD(self) -> None:
        self.send_response(405 if self.path == "/post" else ANSWERS[self.path])
        self.send_header("Location", "/page")
        self.end_headers()

    def do_GET(self) -> None:
        self.send_response(ANSWERS[self.path])
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def site() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Site)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_no_document_links_to_a_file_that_is_not_there() -> None:
    found = [link for file in tool["documents"]() for link in tool["links"](file)]
    files = {link.file for link in found}
    assert {"README.md", "docs/law.md", "docs/how_to/tune_gains.md"} <= files
    assert list(tool["missing"](found)) == []


def test_a_missing_file_is_told_with_its_document(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    (tmp_path / "there.md").touch()
    page.write_text(
        "[a](there.md#part) [b](gone.md) ![c](gone.png) [d](#here)\n"
        "`[code](no.md)`\n\n```\n[fenced](no.md)\n```\n\n"
        "[e]: other.md\nthe clock [s]: when it is told\n"
    )
    told = tool["missing"](tool["links"](page))
    assert [line.split(": ", 1)[1] for line in told] == [
        "gone.md: there is no such file",
        "other.md: there is no such file",
        "gone.png: there is no such file",
    ]
