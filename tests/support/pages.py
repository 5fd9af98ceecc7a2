"""A page as seen by the server, without a browser."""

import asyncio
import json
import threading
from typing import Any
from urllib.parse import urlsplit

import umsgpack
from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClosedError, websocket_connect


def scene_request(url: str, **headers: str) -> HTTPRequest:
    """Return a page's request for the scene: from the page's own origin."""
    address = urlsplit(url)
    origin = f"{address.scheme}://{address.netloc}"
    scene = address._replace(scheme="ws", path="/scene").geturl()
    return HTTPRequest(scene, headers={"Origin": origin} | headers)


class Page(threading.Thread):
    """Acts as a browser: connects, receives commands, and confirms drawing."""

    def __init__(self, url: str, pause: float = 0.0) -> None:
        super().__init__(daemon=True)
        self.url, self.pause = url, pause
        self.commands: list[dict[str, Any]] = []
        self.messages: list[list[dict[str, Any]]] = []
        self.start()

    def run(self) -> None:
        asyncio.run(self.look())

    def leave(self) -> None:
        self.loop.call_soon_threadsafe(self.socket.close)

    async def look(self) -> None:
        page = await websocket_connect(scene_request(self.url))
        protocol = page.protocol  # `leave` detaches it from the page
        self.loop, self.socket = asyncio.get_running_loop(), page
        try:
            while (message := await page.read_message()) is not None:
                self.messages.append(umsgpack.unpackb(message))
                for command in self.messages[-1]:
                    self.commands.append(command)
                    if command["type"] == "ask":
                        await page.write_message(str(command["number"]))
                await asyncio.sleep(self.pause)
                await page.write_message("taken")
        except WebSocketClosedError:
            pass
        finally:
            page.close()
            # The event loop ends here, before the other side can confirm.
            if protocol is not None and protocol.stream is not None:
                protocol.stream.close()

    def last(self, kind: str, path: str) -> dict[str, Any]:
        return next(
            command
            for command in reversed(self.commands)
            if (command["type"], command.get("path")) == (kind, path)
        )


class Steering(Page):
    """A page that sends messages."""

    def say(self, **message: Any) -> None:
        self.send(json.dumps(message))

    def send(self, text: str) -> None:
        async def write() -> None:
            await self.socket.write_message(text)

        asyncio.run_coroutine_threadsafe(write(), self.loop).result(10.0)

    def drives(self) -> tuple[bool, bool] | None:
        reported = [c for c in self.commands if c["type"] == "play_drive"]
        return (reported[-1]["mine"], reported[-1]["taken"]) if reported else None
