"""Addresses ``ros2://name?domain=0``: a name of ROS 2, and options."""

import os
import re
from collections.abc import Collection
from typing import NamedTuple

from hsp_control.common.errors import HardwareError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.shared import name_and_options

SCHEME = "ros2://"
_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_LARGEST_DOMAIN = 232  # beyond, RTPS has no ports for it


class TopicAddress(NamedTuple):
    """The parts of an address.

    Attributes:
        name: A name of ROS 2, beginning with a slash.
        domain: The DDS domain.
        options: The other options.
    """

    name: str
    domain: int
    options: dict[str, str]


def parse(address: str, options: Collection[str] = ()) -> TopicAddress:
    """Parse an address; the domain is ``ROS_DOMAIN_ID``'s, or else 0."""
    address = address.removeprefix(SCHEME)
    where = SCHEME + address
    try:
        name, found = name_and_options(address)
    except ValueError as error:
        raise HardwareError(f"{where}: {error}") from None
    for key in found:
        if key not in {"domain", *options}:
            known = listing(["domain", *options])
            raise HardwareError(
                f"{where}: unknown option "
                f"{key!r}{did_you_mean(key, ['domain', *options])} (known: {known})"
            )
    domain = found.pop("domain", None)
    if domain is None:
        domain, where = os.environ.get("ROS_DOMAIN_ID") or "0", "ROS_DOMAIN_ID"
    if not (domain.isascii() and domain.isdigit() and int(domain) <= _LARGEST_DOMAIN):
        raise HardwareError(
            f"{where}: the domain is {domain!r}; needs 0 to {_LARGEST_DOMAIN}"
        )
    return TopicAddress(checked_name(name), int(domain), found)


def checked_name(name: str) -> str:
    """Return a name of ROS 2 with its leading slash."""
    if not _NAME.fullmatch(name):
        raise HardwareError(
            f"{name!r} is not a ROS 2 name; needs letters, digits and '_' between "
            "slashes, such as /joint_states"
        )
    return name if name.startswith("/") else f"/{name}"
