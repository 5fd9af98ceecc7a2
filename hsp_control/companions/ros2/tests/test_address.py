"""Addresses of topics: missing parts have ROS 2's default, wrong ones are named."""

import pytest

from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2.address import parse


def test_an_address_has_a_name_a_domain_and_options() -> None:
    found = parse("ros2://left/eff?states=/js&domain=7", ("states", "joints"))
    assert found == ("/left/eff", 7, {"states": "/js"})
    assert parse("/left/eff").name == "/left/eff"


@pytest.mark.parametrize(("address", "message"), [
    ("", r"'' is not a ROS 2 name; needs letters"),
    ("a//b", r"'a//b' is not a ROS 2 name"),
    ("1a", r"'1a' is not a ROS 2 name"),
    ("ä", r"'ä' is not a ROS 2 name"),
    ("a?domain", r"ros2://a\?domain: needs options KEY=VALUE&\.\.\."),
    ("a?domain=233", r"the domain is '233'; needs 0 to 232"),
    ("a?domain=-1", r"the domain is '-1'"),
    ("a?state=/b", r"unknown option 'state'; did you mean 'states'\? \(known"),
    ("a?states=/b&states=/c", r"the option 'states' is given twice"),
])  # fmt: skip
def test_errors_are_named(address: str, message: str) -> None:
    with pytest.raises(HardwareError, match=message):
        parse(address, ("states",))
