"""Host names from users, as sockets resolve them."""

import socket


def check_host_name(host: str) -> None:
    """Raise `OSError` for a name that no computer can have, as for an unknown one.

    Python encodes a name before it is looked up. Labels of more than 63 letters and
    empty ones raise `UnicodeError` there, or `TypeError`.
    """
    try:
        host.encode("idna")
    except UnicodeError:
        reason = "not a host name (a part of it is empty, or too long)"
        raise socket.gaierror(socket.EAI_NONAME, reason) from None
