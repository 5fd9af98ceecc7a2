"""Pairs of links that are kept apart, of one robot and of several."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from clearance_cases import agree, flowing, still, turned
from loaded_robots import load
from oracles import gradient
from states import moved

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import AccessError, ModelError
from hsp_control.geometry import Proximity, link_shapes, self_pairs
from hsp_control.null_space.fields import SelfClearance
from hsp_control.robot import RobotDescription
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.robot_description import PlacedRobot
from hsp_control.robot.recorded import recorded_robot, robot_record


def names(robot: Robot) -> set[frozenset[str]]:
    """Return the pairs of links that are watched."""
    proximity = SelfClearance().proximity(still(robot))
    links = proximity.links
    return {frozenset((links[i].link, links[j].link)) for i, j in proximity.pairs}


def disabled(robot: Robot) -> set[frozenset[str]]:
    """Return the pairs that the SRDF disables."""
    assert robot.source.srdf is not None
    return {
        frozenset((pair.attrib["link1"], pair.attrib["link2"]))
        for pair in ElementTree.parse(robot.source.srdf).iter("disable_collisions")
    }


@pytest.mark.parametrize(
    ("text", "reason"),
    [("<robot>", r"arm\.srdf:1:8: malformed XML"),
     ("<?xml version='1.0' encoding='ebcdic-9'?><robot/>", "unknown encoding"),
     (None, r"arm\.srdf: No such file")],
)  # fmt: skip
def test_an_srdf_that_cannot_be_read(
    text: str | None, reason: str, tmp_path: Path
) -> None:
    robot = load("panda")
    srdf = tmp_path / "arm.srdf"
    if text is not None:
        srdf.write_text(text)
    source = replace(robot.source, srdf=srdf)
    with pytest.raises(ModelError, match=reason):
        self_pairs(Robot(robot.model, source), link_shapes(robot))


def test_pairs_of_links_that_are_watched() -> None:
    """All pairs except neighbours, links of one joint, the SRDF's, and overlapping
    ones."""
    robot = load("panda")
    links = link_shapes(robot)
    watched = names(robot)
    without = disabled(robot)
    parents = list(robot.model.parents)
    expected = {
        frozenset((a.link, b.link))
        for i, a in enumerate(links)
        for b in links[i + 1 :]
        if a.joint != b.joint
        and parents[a.joint] != b.joint
        and parents[b.joint] != a.joint
        and frozenset((a.link, b.link)) not in without
    }
    by_srdf_or_chain = {
        frozenset((links[i].link, links[j].link)) for i, j in self_pairs(robot, links)
    }
    assert by_srdf_or_chain == expected
    assert frozenset(("panda_link0", "panda_hand")) in watched
    assert frozenset(("panda_link3", "panda_link4")) not in watched  # neighbours
    assert frozenset(("panda_hand", "panda_leftfinger")) not in watched  # one joint
    assert without  # with pairs in the SRDF
    assert not watched & without
    assert watched <= expected
    home = still(robot)
    state_of = Proximity(robot, links, [], self_pairs(robot, links))
    overlap = {
        pair
        for pair, d in zip(state_of.pairs, state_of.measure(home), strict=True)
        if d <= 0.0
    }
    field = SelfClearance()
    assert set(field.proximity(home).pairs) == set(state_of.pairs) - overlap
    assert field.minimum_distance(home) > 0.0


@pytest.mark.slow
def test_each_robot_is_the_others_moving_obstacle() -> None:
    """Gradient and rate of the pairs between two arms that both move."""
    panda = load("panda")
    beside = pin.SE3(turned(0.0, 0.0, np.pi), np.array([1.0, 0.1, 0.0]))
    both = Robot.combine({"a": (panda, pin.SE3.Identity()), "b": (panda, beside)})
    field = SelfClearance(influence=0.3)
    rng = np.random.default_rng(14)
    agreed = 0
    while agreed < 4:
        q, v = both.random_configuration(rng), 0.5 * rng.normal(size=14)
        state = both.state(0.0, q, v)
        d, pair = field.proximity(state).nearest(state)
        one, two = (name[:2] for name in pair.split(" to "))
        if not 0.06 < d < 0.25 or one == two:
            continue
        g, g_dot = field.gradient(state), field.gradient_rate(state)

        def value(x: Array, q: Array = q, v: Array = v) -> float:
            return field.value(moved(both, 0.0, both.integrate(q, x), v))

        by_value = [gradient(value, 14, h) for h in (1e-3, 5e-4)]
        by_flow = [flowing(field, state, h) for h in (1e-3, 5e-4)]
        if not (agree(*by_value) and agree(*by_flow)):
            continue
        agreed += 1
        scale = float(np.abs(g).max())
        np.testing.assert_allclose(g, by_value[1], rtol=0, atol=1e-9 * scale)
        scale = float(np.abs(g_dot).max())
        np.testing.assert_allclose(g_dot, by_flow[1], rtol=0, atol=3e-8 * scale)
        assert np.abs(g[:7]).max() > 1e-2
        assert np.abs(g[7:]).max() > 1e-2


# --- the SRDF of a robot from a file -------------------------------------------------


def arm_with_srdf(folder: Path, name: str) -> tuple[Path, set[frozenset[str]]]:
    """Write a Panda and an SRDF that disables one pair; return its file and pair."""
    robot = load("panda")
    urdf = folder / "arm.urdf"
    urdf.write_text(robot.source.urdf.read_text())
    pair = "panda_link0", "panda_hand"
    (folder / name).write_text(
        f'<robot name="arm"><disable_collisions link1="{pair[0]}" link2="{pair[1]}" '
        'reason="Never"/></robot>'
    )
    return urdf, {frozenset(pair)}


def test_the_srdf_beside_a_urdf_leaves_pairs_out(tmp_path: Path) -> None:
    urdf, pair = arm_with_srdf(tmp_path, "arm.srdf")
    with_it = names(Robot.load(urdf))
    (tmp_path / "arm.srdf").unlink()
    assert names(Robot.load(urdf)) - with_it == pair


def test_an_srdf_disables_all_pairs_of_a_link_but_some(tmp_path: Path) -> None:
    """As in MoveIt, also in a log's record; a disabled pair stays disabled."""
    urdf, _ = arm_with_srdf(tmp_path, "pairs.srdf")
    every = names(Robot.load(urdf))
    kept, other, both = (
        frozenset(("panda_link0", other))
        for other in ("panda_hand", "panda_link5", "panda_link6")
    )
    assert every >= {kept, other, both}

    def pair(tag: str, links: frozenset[str]) -> str:
        first, second = links
        return f'<{tag} link1="{first}" link2="{second}"/>'

    srdf = tmp_path / "pairs.srdf"
    srdf.write_text(
        '<robot><disable_default_collisions link="panda_link0"/>'
        + pair("enable_collisions", kept)
        + pair("enable_collisions", both)
        + pair("disable_collisions", both)
        + "</robot>"
    )
    robot = Robot.load(urdf, srdf=srdf)
    expected = {links for links in every if "panda_link0" not in links} | {kept}
    assert names(robot) == expected
    assert names(recorded_robot(robot_record(robot))) == expected
    free = {"mimic": False}
    two = Robot.load(RobotDescription(parts={
        "left": PlacedRobot(urdf, **free, srdf=srdf),
        "right": PlacedRobot(urdf, **free, position=(0.0, 5.0, 0.0)),
    }))  # fmt: skip
    assert names(recorded_robot(robot_record(two))) == names(two)
    assert frozenset(("left_panda_link0", "left_panda_link5")) not in names(two)
    assert frozenset(("right_panda_link0", "right_panda_link5")) in names(two)
    assert frozenset(("left_panda_link0", "right_panda_link5")) in names(two)


def test_an_srdf_may_be_named(tmp_path: Path) -> None:
    """In Python and in YAML, beside the configuration."""
    urdf, pair = arm_with_srdf(tmp_path, "pairs.srdf")
    without = names(Robot.load(urdf))
    assert without - names(Robot.load(urdf, srdf=tmp_path / "pairs.srdf")) == pair
    described = RobotDescription("arm.urdf", srdf="pairs.srdf").located(tmp_path)
    assert without - names(Robot.load(described)) == pair
    free = {"mimic": False}
    parts = {"left": PlacedRobot(urdf, **free, srdf=tmp_path / "pairs.srdf"),
             "right": PlacedRobot(urdf, **free, position=(0.0, 5.0, 0.0))}  # fmt: skip
    two = names(Robot.load(RobotDescription(parts=parts)))
    assert frozenset(("right_panda_link0", "right_panda_hand")) in two
    assert frozenset(("left_panda_link0", "left_panda_hand")) not in two
    with pytest.raises(ModelError, match=r"srdf: no such file .*none\.srdf"):
        Robot.load(urdf, srdf=tmp_path / "none.srdf")
    with pytest.raises(ModelError, match="srdf is not for mjcf"):
        RobotDescription(mjcf="scene.xml", srdf="arm.srdf")
    with pytest.raises(ModelError, match="srdf: give it for each of the parts"):
        RobotDescription(parts=parts, srdf="arm.srdf")
    closed = only_within([tmp_path / "elsewhere"])
    with pytest.raises(AccessError, match=r"pairs\.srdf"):
        Robot.load("panda", srdf=tmp_path / "pairs.srdf", access=closed)
