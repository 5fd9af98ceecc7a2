"""The sources of a stream's messages: `send`, an address, or a recording."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Thread
from typing import Any, Protocol
from weakref import WeakValueDictionary, ref

from hsp_control.common.entry_points import entry_points
from hsp_control.common.errors import StreamError
from hsp_control.common.regular_file import why_endless
from hsp_control.common.suggestions import did_you_mean
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Message, Space, message_of, parsed

Listen = Callable[["ref[Inbox]"], None]
"""Puts received messages into an inbox while that exists."""


class AddressKind(Protocol):
    """A kind of address: a module, an entry point of ``hsp_control.targets``."""

    def check_address(self, source: str) -> object:
        """Raise if the address is invalid."""

    def is_local(self, source: str) -> bool:
        """Return whether only this computer can send to it."""

    def opened(self, source: str, space: Space) -> Listen:
        """Open it."""


_inboxes: WeakValueDictionary[str, Inbox] = WeakValueDictionary()
_threads: dict[str, Thread] = {}


def is_address(source: str) -> bool:
    """Return whether a source is another process, not a recording."""
    return "://" in source


def listening_inbox(source: str, space: Space) -> Inbox:
    """Return the inbox of an address, one per process; it closes when unused."""
    known = _inboxes.get(source)
    if known is not None and not known.failure:
        if known.space != space:
            raise StreamError(
                f"{source} already carries {known.space.width} numbers; this stream "
                f"needs {space.width}"
            )
        return known
    if source in _threads:  # of an unused inbox: the port is soon free
        _threads[source].join()
    listen = kind_of(source).opened(source, space)
    inbox = Inbox(space, source)
    _inboxes[source] = inbox
    _threads[source] = Thread(
        target=_run, args=(listen, ref(inbox)), name=f"stream {source}", daemon=True
    )
    _threads[source].start()
    return inbox


def _run(listen: Listen, inbox: "ref[Inbox]") -> None:
    """Listen; errors are raised in the readers of the inbox."""
    try:
        listen(inbox)
    except BaseException as error:
        if (there := inbox()) is not None:
            there.fail(error)


def kind_of(source: str) -> AddressKind:
    """Return the module of an address's kind."""
    kinds = entry_points("targets")
    if found := kinds.get(source.partition("://")[0]):
        kind: AddressKind = found.load()
        return kind
    schemes = [f"{name}://" for name in sorted(kinds)]
    meant = did_you_mean(f"{source.partition('://')[0]}://", schemes)
    raise StreamError(
        f"source is {source!r}{f'{meant} An' if meant else '; an'} address begins with "
        f"{' or '.join(schemes) or 'none'}, and the path of a recording contains no "
        "'://'"
    )


LARGEST_FILE = 100_000_000  # maximum size of a recording [bytes]


def recorded(
    data: Sequence[Mapping[str, Any]], space: Space, file: str = ""
) -> list[Message]:
    """Return the messages of a recording, with their times ``at``."""
    messages: list[Message] = []
    for k, each in enumerate(data):
        try:
            if not isinstance(each, Mapping) or not _is_number(each.get("at")):
                raise StreamError("it needs the time at which it is taken: at [s]")
            at = float(each["at"])
            if messages and at < messages[-1].at:
                raise StreamError(f"at is {at:g}, earlier than {messages[-1].at:g}")
            rest = {key: value for key, value in each.items() if key != "at"}
            messages.append(message_of(rest, space))
            messages[-1].times[:, 2] = at
        except StreamError as error:
            place = f"{file}: " if file else ""
            raise StreamError(f"{place}message {k} of the recording: {error}") from None
    return messages


def read_recording(path: Path) -> list[dict[str, Any]]:
    """Return the messages in a file of JSON lines."""
    try:
        if path.is_dir():
            raise StreamError(f"{path}: no file, but a folder")
        if why := why_endless(path):
            raise StreamError(f"{path}: {why}; no recording")
        if (size := path.stat().st_size) > LARGEST_FILE:
            raise StreamError(
                f"{path}: {size} bytes; a recording has at most {LARGEST_FILE}"
            )
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StreamError(f"{path}: the recording cannot be read: {error}") from None
    found = []
    for k, line in enumerate(lines):
        if not line.strip():
            continue
        try:
            found.append(parsed(line))
        except (ValueError, RecursionError) as error:
            raise StreamError(f"{path}:{k + 1}: not JSON: {error}") from None
    return found


def _is_number(value: object) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) < float("inf")  # type: ignore[arg-type]
