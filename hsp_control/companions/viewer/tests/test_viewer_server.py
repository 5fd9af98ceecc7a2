"""The view's server: reachable on this machine only, without residues at its end."""

import asyncio
import errno
import gzip
import hmac
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
import webbrowser
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from odd_errors import OddError
from pages import Page, Steering, scene_request
from played import wait_until
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from hsp_control import Robot, Rollout
from hsp_control.common.errors import ExportError, ViewerError
from hsp_control.companions.viewer import (
    SceneRecorder,
    Viewer,
    offline_page,
    page_server,
    transport,
)
from hsp_control.companions.viewer.commands import (
    CAMERA,
    CAPTION,
    CLIP,
    LatestCommands,
    PageCommand,
    key_of,
    page_command,
)
from hsp_control.companions.viewer.page_server import Hub
from hsp_control.companions.viewer.transport import PageServer, page_key
from hsp_control.geometry import Scene

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@pytest.fixture
def recorder() -> SceneRecorder:
    return SceneRecorder()


@pytest.fixture
def started() -> Iterator[PageServer]:
    server = PageServer()
    yield server
    server.close()


# --- the server ----------------------------------------------------------------------


def port_of(url: str | None) -> int:
    assert url is not None
    return int(url.partition("?")[0].rsplit(":", 1)[1].strip("/"))


def answers(port: int) -> bool:
    with socket.socket() as client:
        client.settimeout(60.0)
        return client.connect_ex(("127.0.0.1", port)) == 0


@LINUX
def test_it_listens_on_the_loopback_address_alone(started: PageServer) -> None:
    port = f":{port_of(started.url):04X}"
    listening = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            if local.endswith(port) and state in {"0A", "07"}:
                listening.append((table, local))
    assert listening == [("tcp", f"0100007F{port}")]  # 127.0.0.1, and only there


def test_closing_leaves_nothing(arm: Robot) -> None:
    with Viewer(arm) as viewer:
        port = port_of(viewer.url)
        assert answers(port)
        viewer.show(arm.home())
    assert not answers(port)
    assert not any(each.name == "page server" for each in threading.enumerate())
    viewer.close()  # twice is no error
    with pytest.raises(ViewerError, match="the viewer is closed"):
        viewer.show(arm.home())


@pytest.mark.process
def test_closing_ends_connections_and_so_does_the_program(arm: Robot) -> None:
    with Viewer(arm) as viewer:
        assert viewer.url is not None
        page = Page(viewer.url)
        assert viewer.wait_for_browser(200.0)
    page.join(60.0)
    assert not page.is_alive()
    code = """if True:
        from hsp_control.companions.viewer.transport import PageServer
        print(PageServer().url, flush=True)
    """
    run = [sys.executable, "-c", code]
    ended = subprocess.run(run, capture_output=True, text=True, timeout=60.0)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert not answers(port_of(ended.stdout.strip()))


@LINUX
def test_without_a_browser_nothing_waits(
    arm: Robot, run: Rollout, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    with Viewer(arm, open_browser=True) as viewer:
        viewer.play(run)
        for _ in range(5000):  # more than the buffer of a pipe
            viewer.show(arm.home())
        assert not viewer.wait_for_browser(0.0)


def test_a_notebook_contains_its_output(arm: Robot, recorder: SceneRecorder) -> None:
    with Viewer(arm) as viewer:
        shown = viewer._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert f'href="{viewer.url}"' in shown
    assert "127.0.0.1" not in Viewer(arm, transport=recorder)._repr_html_()


def test_without_a_mesh_reader_a_notebook_shows_the_live_page(
    arm: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ExportError("it needs trimesh <here>")

    monkeypatch.setattr(offline_page, "reduce_scene", fail)
    with Viewer(arm) as viewer:
        shown = viewer._repr_html_()
        assert f'<iframe src="{viewer.url}"' in shown
        assert "trimesh &lt;here&gt;" in shown


def test_a_page_that_opens_late_sees_everything(arm: Robot, run: Rollout) -> None:
    with Viewer(arm) as viewer:
        assert viewer.url is not None
        viewer.draw_scene(run)
        viewer.show(arm.home())
        viewer.transport.send([])
        first = Page(viewer.url)
        assert viewer.wait_for_browser(200.0)
        kinds = [(command["type"], command.get("path")) for command in first.commands]
        assert ("set_object", "/robot/joint3/link3") in kinds
        assert ("trail", "/paths/tip/desired") in kinds
        assert ("clip", CLIP) in kinds
        assert ("camera", CAMERA) in kinds
        stage, whole = first.messages[0], [c for m in first.messages[1:] for c in m]
        kinds = [(command["type"], command.get("path")) for command in whole]
        assert len(kinds) == len(set(kinds)) + 1  # the background's two colours
        assert all(command in whole for command in stage)
        found = {(command["type"], command["path"]) for command in stage}
        assert {
            ("caption", CAPTION),
            ("status", CAPTION),
            ("camera", CAMERA),
            ("set_property", "/Background"),
            ("set_object", "/lights/key"),
            ("set_object", "/floor/grid"),
            ("set_transform", "/robot/joint3"),
        } <= found
        assert not any(kind == "set_object" and path.startswith("/robot")
                       for kind, path in found)  # fmt: skip
        viewer.draw_scene(Scene())
        second = Page(viewer.url)
        assert viewer.wait_for_browser(200.0)
        wait_until(lambda: second.commands and first.commands[-1] == {
            **second.commands[-1]})  # fmt: skip
        assert ("delete", "/paths") in [
            (c["type"], c.get("path")) for c in first.commands
        ]
        paths = [command.get("path", "") for command in second.commands]
        assert not any(path.startswith("/paths") for path in paths)
    first.join(60.0)
    second.join(60.0)


def test_a_connection_names_host_and_origin(started: PageServer) -> None:
    """No page of another site, no name that resolves to here, no program without
    both."""
    assert started.url is not None
    with pytest.raises(HTTPClientError) as refused:
        asyncio.run(connect(started.url, Host="evil.example"))
    assert refused.value.code == 403
    with pytest.raises(HTTPClientError) as refused:
        asyncio.run(connect(started.url, Origin="http://evil.example"))
    assert refused.value.code == 403
    request = scene_request(started.url)
    del request.headers["Origin"]
    with pytest.raises(HTTPClientError) as refused:
        asyncio.run(opened(request))
    assert refused.value.code == 403


async def connect(url: str, **headers: str) -> None:
    await opened(scene_request(url, **headers))


async def opened(request: HTTPRequest) -> None:
    page = await websocket_connect(request)
    protocol = page.protocol
    page.close()
    if protocol is not None and protocol.stream is not None:
        protocol.stream.close()  # the loop ends before the other side can confirm


# --- pages that steer ----------------------------------------------------------------


@pytest.fixture
def steered() -> Iterator[PageServer]:
    server = PageServer(steerable=True)
    yield server
    server.close()


def heard(server: PageServer, last: str) -> list[dict[str, Any]]:
    """Messages of the pages, up to one of a kind."""
    found: list[dict[str, Any]] = []
    wait_until(
        lambda: found.extend(server.messages()) or (found and found[-1]["do"] == last),
        20.0,
    )
    return found


HANDSHAKE = {
    "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}  # fmt: skip


def test_a_page_needs_the_key(steered: PageServer) -> None:
    assert steered.url is not None
    address, key = steered.url.split("?key=")
    assert len(key) >= 20
    with urllib.request.urlopen(steered.url) as answer:
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert "connect();" in answer.read().decode()
    for query in ("", "?key=", "?key=x", f"?key={key[:-1]}", f"?k={key}"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(address + query)
        refused.value.close()
        assert refused.value.code == 403
        with pytest.raises(HTTPClientError):
            asyncio.run(connect(address + query))
    # Another site's page that knows the key.
    port = int(address.rpartition(":")[2].strip("/"))
    with closing(HTTPConnection("127.0.0.1", port)) as connection:
        evil = HANDSHAKE | {"Origin": "http://evil.example"}
        connection.request("GET", f"/scene?key={key}", headers=evil)
        with connection.getresponse() as answer:
            assert answer.status == 403
    asyncio.run(connect(steered.url))
    # On this computer it is the user's own.
    assert page_key("127.0.0.1") == key != page_key("192.168.1.20")


def test_a_key_that_others_can_read_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    key, file = page_key("127.0.0.1"), tmp_path / "hsp_control" / "page-key"
    assert file.read_text() == key == page_key("127.0.0.1")
    file.chmod(0o644)
    assert page_key("127.0.0.1") != key


def test_a_key_that_cannot_be_written_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that the next start writes one which open pages find again."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(transport.os, "link", full)
        assert page_key("127.0.0.1") != page_key("127.0.0.1")
    assert list((tmp_path / "hsp_control").iterdir()) == []
    assert page_key("127.0.0.1") == page_key("127.0.0.1")


def test_a_page_that_lost_its_program_keeps_its_key(
    steered: PageServer,
) -> None:
    """A listener answers a question if it has the key, and does not learn it."""
    assert steered.url is not None
    address, _, query = steered.url.partition("?")
    key, question = query.removeprefix("key="), "a1b2"
    with urllib.request.urlopen(f"{address}alive?question={question}") as answer:
        reported = answer.read().decode()
    assert reported == hmac.new(key.encode(), question.encode(), "sha256").hexdigest()
    script = (Path(transport.__file__).parent / "page" / "scene.js").read_text()
    asks = script[
        script.index("async function lookForNext") : script.index("// From Pin")
    ]
    assert "fetch(`alive?question=" in asks
    assert "fetch(location" not in asks


def test_meshes_are_compressed_for_pages_that_accept_it(steered: PageServer) -> None:
    text = " ".join(map(str, range(100_000)))
    steered.send([page_command("nothing", "/mesh", "object", text=text)])
    assert steered.url is not None
    plain, packed = (
        asyncio.run(largest_message(steered.url + more)) for more in ("", "&gzip=1")
    )
    assert len(packed) < 0.5 * len(plain)
    assert text.encode() in plain
    assert text.encode() in gzip.decompress(packed)


async def largest_message(url: str) -> bytes:
    """The largest of the messages that build the scene."""
    connection = await websocket_connect(scene_request(url))
    largest = b""
    while len(largest) < 50_000:
        message = await connection.read_message()
        assert isinstance(message, bytes)
        largest = max(largest, message, key=len)
        await connection.write_message("taken")
    protocol = connection.protocol
    connection.close()
    if protocol is not None and protocol.stream is not None:
        protocol.stream.close()  # the event loop ends before the server can confirm
    return largest


def test_hardware_gets_a_key_that_no_earlier_page_has() -> None:
    assert page_key("127.0.0.1", fresh=True) != page_key("127.0.0.1", fresh=True)
    assert page_key("127.0.0.1", fresh=True) != page_key("127.0.0.1")


def test_a_browser_is_started_without_the_key_in_its_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All users see a process's arguments; the file is readable by this user only."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    seen: list[tuple[str, int, str]] = []

    def look(url: str, new: int) -> None:
        file = Path(url.removeprefix("file://"))
        seen.append((url, file.stat().st_mode & 0o777, file.read_text()))

    monkeypatch.setattr(transport.webbrowser, "open", look)
    monkeypatch.setattr(transport, "_READ", 0.0)
    transport._open("http://127.0.0.1:7000/?key=secret")
    ((url, mode, text),) = seen
    assert "secret" not in url
    assert mode == 0o600
    assert "url=http://127.0.0.1:7000/?key=secret" in text
    assert not list((tmp_path / "hsp_control").iterdir())


def test_one_page_steers_at_a_time(steered: PageServer) -> None:
    assert steered.url is not None
    first = Steering(steered.url)
    wait_until(lambda: first.drives() == (True, True))
    second = Steering(steered.url)
    wait_until(lambda: second.drives() == (False, True))
    second.say(do="pause")  # not permitted
    first.say(do="go")
    assert heard(steered, "go") == [{"do": "go"}]
    second.say(do="take_over")
    assert heard(steered, "left") == [{"do": "left"}]
    wait_until(lambda: first.drives() == (False, True))
    wait_until(lambda: second.drives() == (True, True))
    second.say(do="step")
    assert heard(steered, "step") == [{"do": "step"}]
    second.leave()
    assert heard(steered, "left") == [{"do": "left"}]
    wait_until(lambda: first.drives() == (False, False))
    third = Steering(steered.url)
    wait_until(lambda: third.drives() == (True, True))


@pytest.mark.slow
def test_a_flood_is_no_more_than_its_newest_words(steered: PageServer) -> None:
    """2000 unread messages: the last of every kind is used."""
    assert steered.url is not None
    page = Steering(steered.url)
    wait_until(lambda: page.drives() == (True, True))
    for k in range(2000):
        page.say(do="move", target="hand", pose=[k] * 7)
    page.say(do="obstacle", name="ball", position=[1, 2, 3])
    with urllib.request.urlopen(steered.url) as answer:
        assert answer.status == 200
    found = heard(steered, "obstacle")
    assert found[-1] == {"do": "obstacle", "name": "ball", "position": [1, 2, 3]}
    moves = [each for each in found if each["do"] == "move"]
    assert moves[-1]["pose"] == [1999] * 7
    assert len(moves) < 100


def test_a_refused_message_may_be_long(steered: PageServer) -> None:
    """The reason of a disconnection has 123 bytes at most, or it is not sent."""
    assert steered.url is not None
    page = Steering(steered.url)
    wait_until(lambda: page.drives() == (True, True))
    page.send("y" * 300)
    page.join(20.0)
    assert page.socket.close_code == 1008
    assert page.socket.close_reason.startswith("invalid literal for int()")


@pytest.mark.parametrize(
    ("host", "message"),
    [
        ("224.0.0.1", "address of many computers"),
        ("255.255.255.255", "address of many computers"),
        ("::1", "IPv6 address; give an IPv4 address"),
    ],
)
def test_other_kinds_of_addresses_are_refused(host: str, message: str) -> None:
    with pytest.raises(ViewerError, match=message):
        PageServer(host=host)


@pytest.mark.parametrize("raised", [SystemExit, KeyboardInterrupt])
def test_a_server_that_ends_by_itself_is_reported_and_leaves_nothing(
    raised: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its thread ends at these two; asyncio and Tornado catch all others.

    Its port is outside the range that servers try: another process would use one of
    those as soon as it is free.
    """
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    steered = PageServer(port, steerable=True)

    def fails(*_: object) -> None:
        raise raised("why")

    assert steered.url is not None
    page = Steering(steered.url)
    wait_until(lambda: page.drives() == (True, True))
    monkeypatch.setattr("hsp_control.companions.viewer.page_server.Page._hear", fails)
    page.say(do="go")
    wait_until(lambda: steered._thread.failure)
    page.join(20.0)
    assert not page.is_alive()
    for use in (
        lambda: steered.send([]),
        steered.messages,
        lambda: steered.wait_for_page(0.0),
    ):
        with pytest.raises(ViewerError, match=f"has failed: {raised.__name__}: why"):
            use()
    steered.wait_until_closed()
    PageServer(port).close()
    steered.close()


@pytest.mark.parametrize("raised", [MemoryError, OddError])
def test_a_page_that_cannot_be_served_is_not_open(
    steered: PageServer,
    raised: type[BaseException],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its connection is closed, also during a message to it; others continue."""
    assert steered.url is not None

    def fails(*_: object) -> None:
        raise raised

    of = "hsp_control.companions.viewer.page_server."
    for function in ("Page.ask", "batch_messages", "Page._hear"):
        with monkeypatch.context() as patched:
            patched.setattr(of + function, fails)
            page = Steering(steered.url)
            if function == "Page._hear":
                wait_until(lambda page=page: page.drives())
                page.say(do="go")
            page.join(20.0)
            assert not page.is_alive()
        wait_until(lambda: not steered._hub.pages)
        assert steered._hub.steering is None
    after = Steering(steered.url)
    wait_until(lambda: after.drives() == (True, True))


@pytest.mark.parametrize("raised", [MemoryError, OddError, SystemExit])
@pytest.mark.parametrize("function", ["Hub.steer", "Hub.show_who_steers"])
def test_where_a_page_cannot_be_removed_the_server_ends(
    function: str,
    raised: type[BaseException],
    steered: PageServer,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Otherwise the page's last command would stay in force, and no page could
    steer."""
    assert steered.url is not None
    page = Steering(steered.url)
    wait_until(lambda: page.drives() == (True, True))

    def fails(*_: object) -> None:
        raise raised

    monkeypatch.setattr("hsp_control.companions.viewer.page_server." + function, fails)
    page.leave()
    wait_until(lambda: steered._thread.failure)
    with pytest.raises(ViewerError, match=f"has failed: {raised.__name__}"):
        steered.messages()


def test_the_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ViewerError, match="pip install meshcat"):
        PageServer()


def test_a_server_that_cannot_start_gives_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "meshcat_page", lambda: tmp_path)
    with pytest.raises(ViewerError, match=r"cannot start: .*main\.min\.js"):
        PageServer()


def test_a_port_in_use_is_reported(started: PageServer) -> None:
    with pytest.raises(ViewerError, match=r"cannot start: cannot listen on 127\.0"):
        PageServer(port_of(started.url))


def test_a_browser_is_opened_only_where_there_is_one(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    url, opened = "http://127.0.0.1:7000/", threading.Event()
    monkeypatch.setattr(transport, "_open", lambda url: opened.set())
    monkeypatch.setattr(transport.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not transport.open_browser(url)
    assert f"no display to open a browser on; the view is at {url}" in caplog.text
    monkeypatch.setenv("DISPLAY", ":0")
    terminal = webbrowser.GenericBrowser("w3m")
    monkeypatch.setattr(transport.webbrowser, "get", lambda: terminal)
    assert not transport.open_browser(url)
    assert "w3m would take over the terminal" in caplog.text
    assert not opened.is_set()
    graphical = webbrowser.BackgroundBrowser("firefox")
    monkeypatch.setattr(transport.webbrowser, "get", lambda: graphical)
    assert transport.open_browser(url)
    assert opened.wait(60.0)


# --- its parts -----------------------------------------------------------------------


def test_the_newest_message_is_used_and_order_is_kept() -> None:
    kept = LatestCommands()
    for path, word in (("/a", b"1"), ("/a/b", b"2"), ("/ab", b"3"), ("/a", b"4")):
        kept.keep([PageCommand(path, key_of(path, "object"), word)])
    reported, gone = kept.copy(), PageCommand("/a", key_of("/a", "delete"), b"5", True)
    assert kept.copy().pop_all() == [b"2", b"3", b"4"]
    kept.keep([gone])
    assert [item[0] for item in kept.items()] == ["/ab"]
    reported.keep([gone], deletions=True)
    assert reported.pop_all() == [b"3", b"5"]


@pytest.mark.process
def test_importing_the_package_pulls_in_no_viewer_and_that_no_meshcat() -> None:
    code = """if True:
        import sys, hsp_control
        print(*sys.modules)
        import hsp_control.companions.viewer
        print(*sys.modules)
    """
    run = [sys.executable, "-c", code]
    printed = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    package, viewer = (set(line.split()) for line in printed.splitlines())
    assert not {"tornado", "umsgpack", "hsp_control.companions.viewer"} & package
    assert not {"meshcat", "tornado", "zmq", "IPython", "matplotlib"} & viewer


def test_an_unknown_host_is_named() -> None:
    with pytest.raises(ViewerError, match=r"on no\.such\.host\.invalid: no computer"):
        PageServer(host="no.such.host.invalid")
    with pytest.raises(
        ViewerError, match=r"cannot start: cannot listen on ö.*no computer"
    ):
        PageServer(host=70 * "ö")


def test_nothing_waits_to_be_sent_to_a_page_that_has_left() -> None:
    """Its commands come no more, and the task would wait for them until the end."""
    cancelled = list[str]()
    page = object.__new__(page_server.Page)
    page.hub = Hub(SceneRecorder().scene, steerable=False)
    page.hub.pages.add(page)
    page._delivery = SimpleNamespace(  # type: ignore[assignment]
        cancel=lambda: cancelled.append("delivery")
    )
    page.on_close()
    assert cancelled == ["delivery"]
    assert not page.hub.pages
