"""Firefox on a virtual display, driven over WebDriver BiDi; no driver is needed."""

import asyncio
import base64
import json
import os
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import count
from pathlib import Path
from typing import Any

from browsers import PATIENCE
from tornado.websocket import WebSocketClientConnection, websocket_connect

PROGRAMS = "firefox-esr", "Xvfb"
_PREFERENCES = {
    "webgl.force-enabled": True,
    "security.sandbox.content.level": 0,  # otherwise pages of root may not load Mesa
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
}


def is_installed() -> bool:
    return all(map(shutil.which, PROGRAMS))


class Firefox:
    """A tab of a browser.

    Attributes:
        wrong: Errors and warnings of its console.
    """

    def __init__(self, socket: WebSocketClientConnection) -> None:
        self._socket, self._numbers = socket, count(1)
        self._tab = ""
        self.wrong: list[str] = []

    async def begin(self) -> None:
        await self._do("session.new", capabilities={})
        tree = await self._do("browsingContext.getTree")
        self._tab = tree["contexts"][0]["context"]
        await self._do("session.subscribe", events=["log.entryAdded"])

    async def _do(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._numbers)
        command = {"id": number, "method": method, "params": params}
        await self._socket.write_message(json.dumps(command))
        while True:
            text = await asyncio.wait_for(self._socket.read_message(), PATIENCE)
            assert text is not None, "the browser has ended"
            message = json.loads(text)
            entry = message.get("params", {})
            if message.get("method") == "log.entryAdded" and entry["level"] != "info":
                self.wrong.append(f"{entry['level']}: {entry['text']}")
            if message.get("id") == number:
                assert message["type"] == "success", message
                return dict(message["result"])

    async def open(self, url: str) -> None:
        await self._do(
            "browsingContext.navigate", context=self._tab, url=url, wait="complete"
        )

    async def resize(self, width: int, height: int, ratio: float = 1.0) -> None:
        size = {"width": width, "height": height}
        await self._do(
            "browsingContext.setViewport",
            context=self._tab, viewport=size, devicePixelRatio=ratio,
        )  # fmt: skip

    async def evaluate(self, expression: str) -> Any:
        """Return the value of an expression, by JSON."""
        answer = await self._do(
            "script.evaluate", expression=f"JSON.stringify({expression})",
            target={"context": self._tab}, awaitPromise=True,
        )  # fmt: skip
        assert answer["type"] == "success", answer
        return json.loads(answer["result"].get("value", "null"))

    async def until(self, expression: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while not await self.evaluate(f"Boolean({expression})"):
                await asyncio.sleep(0.1)

    async def drag(self, x: float, y: float, dx: float, dy: float) -> None:
        """Press the mouse at a pixel, move it in eight steps, and release it."""
        moves = [
            {"type": "pointerMove", "x": round(x + dx * k / 8),
             "y": round(y + dy * k / 8), "duration": 30}
            for k in range(9)
        ]  # fmt: skip
        moves[1:1] = [{"type": "pointerDown", "button": 0}]
        moves.append({"type": "pointerUp", "button": 0})
        mouse = {"type": "pointer", "id": "mouse", "actions": moves}
        await self._do("input.performActions", context=self._tab, actions=[mouse])

    async def press(self, key: str) -> None:
        """Press and release a key."""
        strokes = [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]
        keyboard = {"type": "key", "id": "keyboard", "actions": strokes}
        await self._do("input.performActions", context=self._tab, actions=[keyboard])

    async def picture(self) -> bytes:
        """Return its picture as a PNG."""
        shot = await self._do("browsingContext.captureScreenshot", context=self._tab)
        return base64.b64decode(shot["data"])


@asynccontextmanager
async def started(folder: Path) -> AsyncIterator[Firefox]:
    """A browser whose profile is in an empty folder."""
    lines = (
        f'user_pref("{name}", {json.dumps(value)});'
        for name, value in _PREFERENCES.items()
    )
    (folder / "user.js").write_text("\n".join(lines))
    read, write = os.pipe()
    display = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x1000x24"],
        pass_fds=[write], stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    with os.fdopen(read) as told:
        number = told.readline().strip()
    wanted = {"DISPLAY": f":{number}", "HOME": str(folder)}
    browser = subprocess.Popen(
        ["firefox-esr", "--no-remote", "--profile", str(folder),
         "--remote-debugging-port", "0"],
        env=os.environ | wanted, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert browser.stderr is not None
        found = (re.search(r"BiDi listening on (\S+)", line) for line in browser.stderr)
        address = next(filter(None, found))[1]
        socket = await websocket_connect(f"{address}/session", max_message_size=1 << 27)
        page = Firefox(socket)
        await page.begin()
        yield page
        socket.close()
    finally:
        for process in (browser, display):
            process.terminate()
            process.wait()
        browser.stderr.close()
