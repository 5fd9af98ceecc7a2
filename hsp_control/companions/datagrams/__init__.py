"""Targets and states as JSON datagrams, ``udp://HOST:PORT``, for any language."""

from .telling import publish as publish
