"""A finding names the implausible value, and a remedy that works."""

import json
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from odd_robots import FACES, OCTAHEDRON, write_stl
from robot_texts import ARM, INERTIA, joint, link, robot_xml

from hsp_control import Robot
from hsp_control.cli import main
from hsp_control.companions.inspection.findings import Finding, inspect
from hsp_control.robot import RobotDescription

LIMIT = '<limit lower="-3" upper="3" effort="9" velocity="9"/>'


@pytest.fixture
def look(tmp_path: Path) -> Callable[..., dict[str, list[Finding]]]:
    """Return the findings in a text, by check."""

    def look_at(text: str, **options: bool) -> dict[str, list[Finding]]:
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        description = RobotDescription(path, **options)  # type: ignore[arg-type]
        found: dict[str, list[Finding]] = {}
        for finding in inspect(description).findings:
            found.setdefault(finding.check, []).append(finding)
        return found

    return look_at


Look = Callable[..., dict[str, list[Finding]]]


@pytest.mark.parametrize("name", ["iiwa14", "panda", "planar3r"])
def test_nothing_is_odd_about_bundled_robots(name: str) -> None:
    description = RobotDescription(name)
    inspection = inspect(description)
    assert [f for f in inspection.findings if f.severity != "note"] == []
    assert inspection.loads


def test_shapes_that_parsers_refuse_are_named(look: Look) -> None:
    shapes = "".join(
        f"<collision><geometry>{shape}</geometry></collision>"
        for shape in ("", "<cone/>", "<cylinder/>", '<capsule radius="1" length="1"/>')
    )
    found = look(ARM.replace("</inertial>", f"</inertial>{shapes}", 1))["shape"]
    assert {f.element for f in found} == {"link 'upper'"}
    assert [f.message for f in found] == [
        "a collision shape: a shape without geometry",
        "a collision shape: <cone> is none of <box>, <cylinder>, <capsule>, <sphere>, "
        "<mesh>",
        "a collision shape: <cylinder> without length and radius",
    ]


def test_all_wrong_elements_are_listed_not_only_the_first(look: Look) -> None:
    text = ARM.replace('mass value="2"', 'mass value="two"')
    text = text.replace('xyz="0 0 1"', 'xyz="0 0 0"', 1)
    found = look(text)["element"]
    assert [f.element for f in found] == [
        "link 'upper': <mass>",
        "link 'lower': <mass>",
        "joint 'shoulder': <joint>",
    ]
    assert {f.severity for f in found} == {"error"}


def test_inertias_are_named_and_their_cure_helps(look: Look) -> None:
    heavy = ARM.replace(INERTIA, INERTIA.replace('izz="0.1"', 'izz="0.5"'), 1)
    (found,) = look(heavy)["inertia"]
    assert (found.severity, found.element) == ("warning", "link 'upper'")
    assert "0.1 + 0.1 = 0.2" in found.message
    rounded = INERTIA.replace('0.1" i', '-5e-20" i').replace('izz="0.1"', 'izz="{}"')
    assert "inertia" not in look(ARM.replace(INERTIA, rounded.format(-7e-9), 1))
    (found,) = look(ARM.replace(INERTIA, rounded.format(-9e-9), 1))["inertia"]
    assert (
        found.severity == "error"
    )  # a second moment is -4.5e-9, beyond 1e-9 m² times 4 kg
    assert "a principal moment is -9e-09 kg·m²; must not be negative" in found.message
    weightless = ARM.replace('<mass value="2"/>', '<mass value="0"/>', 1)
    (found,) = look(weightless)["inertia"]
    assert found.message == "it has an inertia, but its mass is 0"


@pytest.mark.parametrize(("limit", "severity", "message"), [
    (LIMIT.replace("-3", "4"), "error", "lower limit 4 is above its upper limit 3"),
    (LIMIT.replace("-3", "3"), "warning", "both 3: treated as no limit"),
    ("", "error", "revolute without <limit>"),
    (LIMIT.replace('effort="9"', ""), "error", "<limit> without effort"),
    (LIMIT.replace('"9"', '"-1"', 1), "error", "effort limit -1 is negative"),
    (LIMIT.replace('"9"', '"0"'), "note", "no effort and no velocity limit"),
])  # fmt: skip
def test_limits(limit: str, severity: str, message: str, look: Look) -> None:
    (found,) = look(ARM.replace(LIMIT, limit, 1))["limit"]
    assert (found.severity, found.element) == (severity, "joint 'shoulder'")
    assert message in found.message


def test_meshes_that_are_missing_are_named_with_their_links(
    look: Look, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shape = "<{0}><geometry><mesh filename='package://acme/a.stl'/></geometry></{0}>"
    shapes = shape.format("collision") + shape.format("visual")
    found = look(ARM.replace(INERTIA, INERTIA + shapes))
    assert [f.element for f in found["mesh"]] == [
        "collision meshes of upper, lower",
        "visual meshes of upper, lower",
    ]
    assert all("ROS_PACKAGE_PATH=<the folder that" in f.cure for f in found["mesh"])
    assert found["self-collision"][0].message.startswith("not checked: a collision mes")
    (tmp_path / "ros" / "acme").mkdir(parents=True)
    write_stl(tmp_path / "ros" / "acme" / "a.stl", OCTAHEDRON, FACES)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    assert "mesh" not in look(ARM.replace(INERTIA, INERTIA + shapes))


def test_links_that_overlap_at_home_are_listed(look: Look) -> None:
    ball = '<collision><geometry><sphere radius="2"/></geometry></collision>'
    chain = [link("base", ""), *(link(n, INERTIA + ball) for n in "abc")]
    joints = [joint(f"{a}{b}", a, b) for a, b in (("base", "a"), "ab", "bc")]
    (found,) = look(robot_xml(*chain, *joints))["self-collision"]
    assert found.element == "'a' and 'c'"
    assert "overlap at home by 2." in found.message


def test_a_mass_matrix_that_is_nearly_singular(look: Look) -> None:
    light = ARM.replace('value="2"', 'value="2e-9"').replace('="0.1"', '="1e-10"')
    heavy_first = light.replace('value="2e-9"', 'value="2"', 1)
    (found,) = look(heavy_first)["mass matrix"]
    assert found.element == "joint 'elbow'"
    assert "condition number of M reaches" in found.message


def test_the_inertia_at_a_joint_is_what_a_motor_there_feels(
    look: Look, tmp_path: Path
) -> None:
    """With the other joints free: the Schur complement of M at home."""
    light = ARM.replace('value="2"', 'value="2e-4"').replace('="0.1"', '="1e-5"')
    (found,) = look(light.replace('value="2e-4"', 'value="2"', 1))["rotors"]
    robot = Robot.load(tmp_path / "arm.urdf")
    M = robot.state(0.0, robot.home(), np.zeros(2)).mass_matrix
    felt = M[1, 1] - M[0, 1] ** 2 / M[0, 0]
    assert found.element == "joint 'elbow'"
    assert f"at home the inertia at this joint is {felt:.1g} kg m²" in found.message


def test_motors_that_cannot_hold_the_robot_at_home(look: Look, tmp_path: Path) -> None:
    """The effort against gravity is the gradient of the potential energy."""
    assert "effort" not in look(ARM)
    robot = Robot.load(tmp_path / "arm.urdf")
    model, home = robot.model, robot.home()

    def energy(q: NDArray[np.float64]) -> float:
        return float(pin.computePotentialEnergy(model, model.createData(), q))

    turns = 1e-4 * np.eye(2)
    slope = [abs(energy(home + turn) - energy(home - turn)) / 2e-4 for turn in turns]
    assert min(slope) < 0.9 * max(slope)  # the limit between them is one joint's
    limit = 0.5 * (min(slope) + max(slope))
    weak = ARM.replace('effort="9"', f'effort="{limit}"')
    (found,) = look(weak)["effort"]
    assert found.element == f"joint {robot.dof_names[int(np.argmax(slope))]!r}"
    required = f"gravity requires {max(slope):.3g} N·m of it, its limit is {limit:.3g}"
    assert found.message == f"at home {required}"
    # none is satisfied
    assert "effort" not in look(ARM.replace('effort="9"', 'effort="0"'))


def test_a_robot_that_does_not_load_is_an_error(look: Look) -> None:
    (found,) = look(ARM.replace(INERTIA, ""))["robot"]
    assert "no link that moves has a mass" in found.message


# --- the command ---------------------------------------------------------------------


def test_printed_lines_fit_a_terminal_and_many_elements_are_cut(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.urdf"
    names = [f"l{k}" for k in range(15)]
    wrong = INERTIA.replace('izz="0.1"', 'izz="0.5"')
    joints = [joint(f"j{k}", f"l{k}", f"l{k + 1}") for k in range(14)]
    path.write_text(robot_xml(*(link(name, wrong) for name in names), *joints))
    assert main(["inspect", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "condition number" in printed
    assert max(map(len, printed.replace(str(tmp_path), "").splitlines())) <= 80
    assert "... 15 in all; --json lists them" in printed
    assert "project_inertias: true takes the nearest possible one" in printed
    assert main(["inspect", str(path), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert sum(f["check"] == "inertia" for f in data["findings"]) == 15


def test_an_mjcf_is_inspected_as_a_urdf_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    path, capsule = tmp_path / "arm.xml", '<geom type="capsule" size=".05 .1"/>'
    path.write_text(
        '<mujoco model="rod"><worldbody><body><joint name="j" axis="0 1 0"/>'
        f'<body name="b" pos="0.4 0 0"><joint name="k" axis="0 1 0" stiffness="1"/>'
        f'{capsule}<site name="tip" pos="0.3 0 0"/></body>{capsule}</body></worldbody>'
        '<actuator><motor joint="j" ctrlrange="-5 5"/></actuator></mujoco>'
    )
    assert main(["inspect", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "reach         0.7 m from" in printed
    assert "bounds        an error is bounded at 0.245 m and 1.25 rad" in printed
    assert "changes by more than 55 N·m/s" in printed
    assert "note: left out\n  rod: springs at joints k: no force" in printed
    path.write_text(ARM)
    assert main(["inspect", str(path)]) == 0
    assert "robot         arm: nq = 2" in capsys.readouterr().out


def test_fix_writes_a_robot_without_findings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, fixed = tmp_path / "arm.urdf", tmp_path / "new" / "arm.urdf"
    fixed.parent.mkdir()
    mesh = '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'
    write_stl(tmp_path / "a.stl", OCTAHEDRON, FACES)
    wrong = INERTIA.replace('izz="0.1"', 'izz="-0.5"')
    path.write_text(ARM.replace(INERTIA, wrong + mesh, 1))
    assert main(["inspect", str(path), "--fix", str(fixed)]) == 2  # does not load
    assert f"Written with projected inertias: {fixed}" in capsys.readouterr().out
    assert 'filename="../a.stl"' in fixed.read_text()
    repaired = Robot.load(fixed).model.inertias[1]
    projected = Robot.load(path, project_inertias=True).model.inertias[1]
    assert repaired.isApprox(projected, 1e-14)
    assert main(["inspect", str(fixed)]) == 0
    assert main(["inspect", str(path), "--fix", str(path)]) == 2
    assert "is the robot's own file; give another" in capsys.readouterr().err


def test_mistakes_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", "pnada"]) == 2
    assert "did you mean 'panda'" in capsys.readouterr().err
    (tmp_path / "arm.urdf").write_text(ARM)
    assert main(["inspect", str(tmp_path / "arm.urdf"), "mass=3"]) == 2
    assert "'mass=3': an argument of a xacro file is name:=value" in (
        capsys.readouterr().err
    )


def test_after_an_inspection_warnings_are_printed_again() -> None:
    logger = logging.getLogger("hsp_control")
    before = logger.level
    assert before < logging.ERROR
    assert main(["inspect", "planar3r"]) == 0
    assert logger.level == before
