"""A loop's state as JSON datagrams: ``hsp live CONFIG --publish udp://HOST:PORT``."""

from .telling import publish as publish
