"""The way between a live loop and the process of its page: words that never wait."""

import json
import socket
from typing import Any

_LONGEST = 65536


class Channel:
    """One end of a pair of datagram sockets; neither end ever waits for the other."""

    def __init__(self, end: socket.socket) -> None:
        """Take over an end."""
        end.setblocking(False)
        self._end = end
        self.lost = False

    def send(self, word: dict[str, Any]) -> None:
        """Send a word; it is dropped if the other end takes no more."""
        if self.lost:
            return
        try:
            self._end.send(json.dumps(word).encode())
        except BlockingIOError:
            pass  # a newer one follows
        except OSError:
            self.lost = True

    def receive(self, most: int = 100) -> list[dict[str, Any]]:
        """Return the words that have arrived, oldest first."""
        words: list[dict[str, Any]] = []
        while len(words) < most and not self.lost:
            try:
                data = self._end.recv(_LONGEST)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if data:
                words.append(json.loads(data))
            else:
                self.lost = True
        return words

    def close(self) -> None:
        """Close this end; a second call does nothing."""
        self.lost = True
        self._end.close()


def channel_pair() -> tuple[Channel, socket.socket]:
    """Return an end for this process, and the other one for another process."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    return Channel(here), there
