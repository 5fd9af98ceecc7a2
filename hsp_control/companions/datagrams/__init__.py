"""Targets and states as JSON datagrams, ``udp://HOST:PORT``, for any language."""

from .state_sender import publish as publish
