"""The bundled robots agree with their READMEs, read by plain Pinocchio."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yaml
from places import ROOT

from hsp_control import Robot
from hsp_control.geometry import link_shapes

ROBOTS = ROOT / "robots"
NAMES = ["iiwa14", "panda", "planar3r"]
YAML_KEYS = {
    "description",
    "locked",
    "end_effector",
    "home",
    "motor_inertia",
    "joint_coordinates",
    "licence",
    "source",
}
# Mass of the moving links [kg], and the end effector's position at home [m].
EXPECTED = {
    "iiwa14": (25.61, (0.21 + 0.2 * np.sqrt(3), 0.0, 0.034 + 0.21 * np.sqrt(3))),
    "panda": (16.822132, (0.306891, 0.0, 0.486882)),
    "planar3r": (3.0, (0.0, 2.0, 0.0)),
}


def urdf(name: str) -> Path:
    """Return the URDF file of a bundled robot."""
    return ROBOTS / name / f"{name}.urdf"


def robot_yaml(name: str) -> dict[str, Any]:
    """Return the content of a bundled robot's robot.yaml."""
    return yaml.safe_load((ROBOTS / name / "robot.yaml").read_text(encoding="utf-8"))


def load(name: str) -> pin.Model:
    """Return a bundled robot's model with its robot.yaml's joints locked."""
    return lock(pin.buildModelFromUrdf(str(urdf(name))), robot_yaml(name))


def lock(model: pin.Model, settings: dict[str, Any]) -> pin.Model:
    """Return the model without the joints that the settings lock."""
    locked = settings.get("locked", {})
    assert all(model.existJointName(joint) for joint in locked)
    assert not any(locked.values()), "locked elsewhere than at the neutral posture"
    ids = [model.getJointId(joint) for joint in locked]
    return pin.buildReducedModel(model, ids, pin.neutral(model)) if ids else model


def links(path: Path) -> list[ElementTree.Element]:
    """Return the <link> elements of a URDF."""
    return ElementTree.parse(path).getroot().findall("link")


@pytest.mark.parametrize("name", NAMES)
def test_files_name_no_place_on_this_machine(name: str) -> None:
    """No absolute path; no URL but those of licence, mesh package and schema."""
    assert ElementTree.parse(urdf(name)).getroot().attrib["name"] == name
    for file in sorted((ROBOTS / name).rglob("*.*")):
        text = file.read_text(encoding="utf-8")
        assert not re.search(r"(?<![\w./])/(home|root|work|tmp|usr|opt|Users)/", text)
        for address in re.findall(r"\w+://[^\s\"'`)]+", text):
            assert address.startswith(
                (
                    *("package://example-robot-data/", f"package://{name}/meshes/"),
                    *("http://www.apache.org/licenses/", "http://www.collada.org/2005"),
                )
            ), address


@pytest.mark.parametrize("name", NAMES)
def test_robot_yaml(name: str) -> None:
    """Known keys only; at home the end effector is at the documented position."""
    settings = robot_yaml(name)
    assert set(settings) <= YAML_KEYS
    model = load(name)
    mass, position = EXPECTED[name]
    assert pin.computeTotalMass(model) == pytest.approx(mass, abs=1e-12)
    home = np.array(settings["home"])
    assert home.shape == (model.nv,)
    q = pin.integrate(model, pin.neutral(model), home)
    assert (q >= model.lowerPositionLimit).all()
    assert (q <= model.upperPositionLimit).all()
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    assert model.existFrame(settings["end_effector"])
    tip = data.oMf[model.getFrameId(settings["end_effector"])]
    # The Panda's expected position is written to 1e-6 m, the others are exact.
    np.testing.assert_allclose(tip.translation, position, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
def test_every_link_could_be_a_body(name: str) -> None:
    """Positive mass and moments, and no moment above the sum of the other two."""
    bodies = [body for link in links(urdf(name)) for body in link.findall("inertial")]
    assert len(bodies) == {"iiwa14": 8, "panda": 11}[name]
    for body in bodies:
        mass, tensor = body.find("mass"), body.find("inertia")
        assert mass is not None
        assert tensor is not None
        assert float(mass.attrib["value"]) > 0
        xx, xy, xz, yy, yz, zz = (
            float(tensor.attrib[key])
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] > 0
        assert moments[2] < moments[0] + moments[1]


@pytest.mark.parametrize("name", NAMES)
def test_collision_geometry_is_capsules(name: str) -> None:
    """Every link with mass has at least one primitive, and no other shapes."""
    shapes = link_shapes(Robot.load(name))
    assert {type(shape.geometry).__name__ for shape in shapes} == {"Capsule"}
    assert len(shapes) == {"iiwa14": 9, "panda": 13, "planar3r": 3}[name]
    heavy = {
        k.attrib["name"] for k in links(urdf(name)) if k.find("inertial") is not None
    }
    assert {shape.link for shape in shapes} == heavy


@pytest.mark.parametrize("name", ["iiwa14", "planar3r"])
def test_geometry_needs_no_other_file(name: str) -> None:
    """Visual and collision geometry build without any package folder."""
    model = pin.buildModelFromUrdf(str(urdf(name)))
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        geometry = pin.buildGeomFromUrdf(model, str(urdf(name)), kind)
        assert geometry.ngeoms > 0
        for shape in geometry.geometryObjects:
            assert shape.meshPath in ("BOX", "CYLINDER", "SPHERE")
