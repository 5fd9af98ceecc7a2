"""Check which name is suggested for one that does not exist."""

from hsp_control.common.suggestions import did_you_mean, nearest


def test_the_nearest_name_is_suggested() -> None:
    frames = ["universe", "panda_link7", "panda_hand", "panda_hand_tcp"]
    assert did_you_mean("panda_hnad", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("hand", frames) == "; did you mean 'panda_hand'?"
    assert did_you_mean("UNIVERSE", frames) == "; did you mean 'universe'?"
    assert did_you_mean("xyz", frames) == ""
    assert nearest("", frames) is None
    assert nearest("a", []) is None
