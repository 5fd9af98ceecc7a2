"""Implausible values, the interpretation of files, and ignored parts are reported."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from mesh_texts import tetrahedron
from odd_robots import FACES, OCTAHEDRON, write_stl
from robot_kinds import chain, follow
from robot_texts import ARM, INERTIA, gripper, joint, link, robot_xml
from wording import wording

from hsp_control.companions.inspection.findings import Finding, inspect
from hsp_control.robot import RobotDescription

Look = Callable[[str], dict[str, list[Finding]]]


@pytest.fixture
def look(tmp_path: Path) -> Look:
    """Return the findings in a text, by check."""

    def look_at(text: str) -> dict[str, list[Finding]]:
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        found: dict[str, list[Finding]] = {}
        for finding in inspect(RobotDescription(path)).findings:
            found.setdefault(finding.check, []).append(finding)
        return found

    return look_at


def arm(mass: float = 2.0, moment: float = 0.02, away: float = 0.1) -> str:
    """Return an arm with links of half a metre."""
    inertia = (
        f'<inertial><origin xyz="{away} 0 0"/><mass value="{mass}"/><inertia '
        f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )
    return ARM.replace(INERTIA, inertia)


@pytest.mark.parametrize(("text", "message"), [
    (arm(), ""),
    (arm(moment=1e-3), ""),
    (arm(mass=0.1, moment=1.0), "of 3.87 m, but it ends 0."),  # an identity
    (arm(moment=2e4), "with a radius of gyration of 122 m, but it ends"),  # kg mm²
    (arm(mass=2000.0), "denser than any metal"),  # g
    (arm(moment=2e-8), "denser than any metal"),
    (arm(moment=0.0), ""),  # point masses
])  # fmt: skip
def test_impossible_bodies_are_named(text: str, message: str, look: Look) -> None:
    found = [f for f in look(text).get("units", []) if f.element.startswith("link")]
    assert bool(found) == bool(message)
    for each in found:
        assert each.element in ("link 'upper'", "link 'lower'")
        assert (each.severity, message in each.message) == ("warning", True)
        assert "kg·m²" in each.cure


def test_inertias_of_fixed_links_are_ignored(look: Look) -> None:
    identity = INERTIA.replace('"0.1"', '"9"')
    assert "units" not in look(arm().replace(link("base", ""), link("base", identity)))


def test_shapes_determine_the_size_of_a_link(look: Look) -> None:
    """A long tool may have a wide inertia."""
    wide = arm(mass=1.0, moment=6.0)
    tool = (
        '<collision><origin xyz="1 0 0" rpy="0 1.57 0"/><geometry>'
        '<cylinder radius="0.02" length="2"/></geometry></collision>'
    )
    assert "units" in look(wide)
    with_tool = wide.replace("</inertial>", f"</inertial>{tool}")
    assert "units" not in look(with_tool)
    ball = tool.replace('cylinder radius="0.02" length="2"', 'sphere radius="{}"')
    for radius, named in ((1.0, False), (0.9, True)):  # k = 3 m, of a third of it
        large = ball.replace('xyz="1 0 0"', 'xyz="0.1 0 0"').format(radius)
        with_ball = wide.replace("</inertial>", f"</inertial>{large}")
        assert ("units" in look(with_ball)) is named


@pytest.mark.parametrize(("factor", "message", "cure"), [
    (1000.0, "the longest chain of joints is 548 m", "are these in mm?"),
    (0.01, "the longest chain of joints is 0.00548 m", "in another unit?"),
])  # fmt: skip
def test_lengths_in_another_unit(
    factor: float, message: str, cure: str, look: Look
) -> None:
    lengths = " ".join(str(factor * x) for x in (0.5, 0.1, 0.2))
    (found,) = [
        f for f in look(arm().replace("0.5 0.1 0.2", lengths))["units"]
        if f.element == "all joints"
    ]  # fmt: skip
    assert message in found.message
    assert cure in found.cure


def test_masses_in_grams(look: Look) -> None:
    """Inertias in g·m²: every link is possible, but the arm is implausible."""
    (found,) = look(arm(mass=2000.0, moment=20.0))["units"]
    assert found.element == "all links"
    assert "4000 kg move, on a chain of 0.548 m" in found.message
    assert "are these in g?" in found.cure


BALL = '<collision><geometry><sphere radius="0.03"/></geometry></collision>'


def test_a_link_that_is_denser_than_any_metal(look: Look) -> None:
    heavy = arm(mass=150.0, moment=9.0)
    assert "units" not in look(heavy)
    found = look(heavy.replace("</inertial>", f"</inertial>{BALL}", 1))["units"]
    assert [f.element for f in found] == ["link 'upper'"]
    assert found[0].message.startswith("150 kg in collision shapes of 0.113 litres")
    light = arm().replace("</inertial>", f"</inertial>{BALL}")
    assert "units" not in look(light)


def test_a_collision_mesh_in_another_unit(look: Look, tmp_path: Path) -> None:
    write_stl(tmp_path / "a.stl", OCTAHEDRON, FACES)
    mesh = '<geometry><mesh filename="a.stl" scale="{0} {0} {0}"/></geometry>'
    for scale, expected in ((1.0, 0), (90.0, 0), (1e3, 1), (1e-3, 1)):
        shapes = (
            f"</inertial><visual>{mesh.format(0.01)}</visual>"
            f"<collision>{mesh.format(0.01 * scale)}</collision>"
        )
        found = look(ARM.replace("</inertial>", shapes, 1)).get("units", [])
        named = [f for f in found if "its collision mesh has a size of" in f.message]
        assert len(named) == expected, scale


@pytest.mark.parametrize(("old", "new", "message"), [
    ('velocity="9"', 'velocity="180"', "its velocity limit is 180 rad/s"),
    ('velocity="9"', 'velocity="1e6"', ""),
    ('effort="9"', 'effort="1e9"', "its effort limit is 1e+09 N·m"),
])  # fmt: skip
def test_maxima_that_no_joint_reaches(
    old: str, new: str, message: str, look: Look
) -> None:
    found = look(ARM.replace(old, new, 1)).get("units", [])
    assert [(f.element, f.message) for f in found] == [
        ("joint 'shoulder'", message)
    ] * bool(message)


def test_limits_of_a_continuous_joint_are_not_used(look: Look) -> None:
    soft = (
        '<safety_controller k_velocity="1" soft_lower_limit="-1" soft_upper_limit="1"/>'
    )
    parts = link("base", ""), link("upper"), joint("a", "base", "upper", "continuous")
    found = look(robot_xml(*parts).replace("</joint>", f"{soft}</joint>"))
    assert "its limits -3 to 3 are not used" in found["limit"][0].message
    assert "its soft limits -1 to 1 are not" in found["soft limits"][0].message
    without = robot_xml(*parts).replace('lower="-3" upper="3" ', "")
    assert not {"limit", "soft limits"} & look(without).keys()


def test_negative_damping(look: Look) -> None:
    damped = '<dynamics damping="-3" friction="2"/></joint>'
    (found,) = look(ARM.replace("</joint>", damped, 1))["dynamics"]
    assert found.element == "joint 'shoulder'"
    assert "its damping -3 is negative, as of a joint that gains energy: 3 is used" in (
        found.message
    )


def test_a_safety_controller_without_its_gain_names_its_joint(look: Look) -> None:
    soft = '<safety_controller soft_lower_limit="-1"/></joint>'
    (found,) = look(ARM.replace("</joint>", soft, 1))["element"]
    assert found.element == "joint 'shoulder': <safety_controller>"
    assert found.message == "the k_velocity is missing, which parsers need"


def test_a_misspelt_leader_is_named_with_the_nearest_joint(look: Look) -> None:
    (found,) = look(gripper().replace('joint="shoulder"', 'joint="shoudler"'))["mimic"]
    assert "'shoudler', which is not a moving joint; did you mean 'shoulder'?" in (
        found.message
    )


def test_limits_in_degrees(look: Look) -> None:
    (found,) = look(ARM.replace('lower="-3" upper="3"', 'lower="-90" upper="90"', 1))[
        "units"
    ]
    assert found.element == "joint 'shoulder'"
    assert "it turns from -90 to 90 rad" in found.message
    assert "degrees" in found.cure
    assert "units" not in look(ARM.replace('"-3" upper="3"', '"-1e5" upper="1e5"', 1))


def test_ignored_elements_are_named(look: Look) -> None:
    extra = (
        '<transmission name="gear"/><gazebo reference="upper"/>'
        '<gazebo reference="lower"/><sensor name="eye"/></robot>'
    )
    text = ARM.replace("</robot>", extra)
    text = text.replace("</joint>", '<calibration rising="0.1"/></joint>', 1)
    found = {f.element: f.message for f in look(text)["not read"]}
    assert found == {
        "<transmission>": "of 'gear' is not read: except its rotor: positions, speeds "
        "and efforts are the joints'",
        "<gazebo>": "of 'upper', 'lower' is not read: only Gazebo uses it",
        "<sensor>": "of 'eye' is not read",
        "<calibration>": "of 'shoulder' is not read: positions are measured from "
        "the zero of the model",
    }
    assert "not read" not in look(ARM)


def test_followers_that_bound_their_leaders_are_named(look: Look) -> None:
    def found(multiplier: float) -> list[Finding]:
        mimic = follow("leader", multiplier)
        text = chain(("leader", "revolute", ""), ("follower", "revolute", mimic))
        return look(text).get("mimic", [])

    assert found(0.5) == []
    (narrow,) = found(2.0)
    assert narrow.severity == "note"
    assert "its limits keep its leader 'leader' within -1.5 to 1.5" in narrow.message
    mimic = follow("leader", 0.9, 1.0)  # the leader's own lower limit is narrower
    text = chain(("leader", "revolute", ""), ("follower", "revolute", mimic))
    (narrow,) = look(text)["mimic"]
    assert "keep its leader 'leader' within -3 to 2.222" in narrow.message
    mimic = follow("leader", 1.0, 9.0)
    text = chain(("leader", "revolute", ""), ("follower", "revolute", mimic))
    (never,) = look(text)["mimic"]
    assert never.severity == "warning"
    assert (
        "from -12 to -6, whose own are -3 to 3: the follower's limits are"
        in never.message
    )
    ghost = chain(("leader", "revolute", follow("ghost")))
    (error,) = look(ghost)["mimic"]
    assert (error.severity, "'ghost'" in error.message) == ("error", True)


def test_soft_limits_and_planes_are_named(look: Look) -> None:
    soft = (
        '<safety_controller k_velocity="1" soft_lower_limit="-1" soft_upper_limit="9"/>'
    )
    (found,) = look(ARM.replace("</joint>", f"{soft}</joint>", 1))["soft limits"]
    assert found.element == "joint 'shoulder'"
    assert "keep it within -1 to 3 of -3 to 3" in found.message
    cart = ARM.replace('"shoulder" type="revolute"', '"shoulder" type="planar"')
    assert "axis" not in look(cart)
    (found,) = look(cart.replace('<axis xyz="0 0 1"/>', "", 1))["axis"]
    assert "planar without <axis>: its plane is x-y" in found.message


def test_transmissions_are_looked_at(look: Look) -> None:
    gear = '<transmission name="{}"><joint name="{}"/></transmission></robot>'
    for transmissions, message in (
        ([("one", "shouldr")], "'shouldr' does not exist; did you mean 'shoulder'?"),
        ([("one", "shoulder"), ("two", "shoulder")], "the last one's rotor is used"),
        ([("one", "shoulder"), ("two", "elbow")], ""),
    ):
        text = ARM
        for each in transmissions:
            text = text.replace("</robot>", gear.format(*each))
        found = look(text).get("transmission", [])
        assert [message in each.message for each in found] == [True] * bool(message)


def test_meshes_that_are_turned_are_named(look: Look, tmp_path: Path) -> None:
    tetrahedron(tmp_path / "y.dae", "0.01", "Y_UP")
    tetrahedron(tmp_path / "z.dae", "0.01", "Z_UP")
    shape = "<visual><geometry><mesh filename='{}'/></geometry></visual>"
    text = ARM.replace(INERTIA, INERTIA + shape.format("y.dae"), 1)
    (found,) = look(text)["mesh"]
    assert found.element == "meshes of upper"
    assert "y as the up axis: it is turned to the link's z" in found.message
    assert "mesh" not in look(text.replace("y.dae", "z.dae"))


def test_an_srdf_is_looked_at(look: Look, tmp_path: Path) -> None:
    srdf = tmp_path / "arm.srdf"
    pair = '<robot><disable_collisions link1="upper" link2="{}"/></robot>'
    srdf.write_text(pair.format("lower"))
    assert "srdf" not in look(ARM)
    srdf.write_text(pair.format("lowr"))
    (found,) = look(ARM)["srdf"]
    assert found.message.startswith("it names links that do not exist: 'lowr'")
    assert "lower" in found.message
    srdf.write_text('<robot><disable_default_collisions link="upper"/></robot>')
    assert "srdf" not in look(ARM)
    for tag in (
        'disable_default_collisions link="uper"',
        'enable_collisions link1="uper"',
    ):
        srdf.write_text(f"<robot><{tag}/></robot>")
        (found,) = look(ARM)["srdf"]
        assert "'uper'" in found.message
    srdf.write_text("<robot>")
    (found,) = look(ARM)["srdf"]
    assert (found.severity, "malformed XML" in found.message) == ("error", True)


def test_the_reason_for_the_choice_of_hand_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    facts = inspect(RobotDescription(path)).facts
    assert re.search(wording("lower (by default): ... 'elbow'"), facts["end effector"])
