"""Find a robot by its name or by the path to its URDF.

The modules of the package robot_descriptions know the repository of each robot, and
clone it at the first import.
"""

import importlib.util
import os
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import yaml

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import AccessError, ModelError, RobotNotFoundError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.resources import bundled_robots, is_file, is_folder
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.xacro_files import expand, is_xacro

PACKAGE = "robot_descriptions"

Root = Literal["fixed", "planar", "free_flyer"]
FILE_ENDINGS = (".urdf", ".xml", ".xacro")
"""A robot's name that ends so is a path."""

# Robots of example-robot-data for which `find_hand` would be wrong: the last link is a
# motor of the gripper.
_END_EFFECTORS = {
    "talos": "gripper_right_base_link",
    "talos_arm": "gripper_left_base_link",
    "talos_box": "gripper_right_base_link",
    "talos_legs": "gripper_right_base_link",
}


PINOCCHIO = "pinocchio"
"""The origin of a robot that was made of a Pinocchio model: it has no URDF."""
ShapeKind = Literal["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]


@dataclass(frozen=True, eq=False)
class BodyShape:
    """A shape that is fixed to a body, visual or for collisions."""

    body: str  # name of the body's frame
    kind: ShapeKind  # its kind
    # the lengths of a box, the radius and the length (of a cylinder, of a capsule
    # without its ends), the radius of a sphere, the semi-axes of an ellipsoid [m]; of a
    # mesh: nothing
    size: tuple[float, ...]
    pose: Array  # its pose in the body's frame, shape (4, 4)
    # red, green, blue and opacity, from 0 to 1
    color: tuple[float, float, float, float]
    seen: bool  # whether it is drawn
    collides: bool  # whether distances and collisions include it
    # of a mesh: its vertices [m], shape (k, 3), and triangles of their indices, shape
    # (n, 3). Collisions are those of its convex hull
    mesh: tuple[Array, Indices] | None = None


@dataclass(frozen=True)
class RobotSource:
    """A robot's source, and the settings in its folder."""

    name: str  # name of a known robot, or the URDF file's name without ``.urdf``
    # the URDF file. Of a robot whose `shapes` are given: the MJCF file, or the name of
    # the MuJoCo or Pinocchio model
    urdf: Path
    # the SRDF file (reference postures, disabled collision pairs), if any
    srdf: Path | None = None
    root: Root = "fixed"  # the default root: ``fixed``, ``planar`` or ``free_flyer``
    package_dirs: tuple[Path, ...] = ()  # folders in which ``package://`` is looked up
    # ``bundled``, ``example-robot-data``, ``robot_descriptions``, ``file``, ``mujoco``,
    # ``pinocchio`` or ``combined``
    origin: str = "file"
    # joints that are locked by default, name to value [rad or m]
    locked: Mapping[str, float] = field(default_factory=dict)
    end_effector: str | None = None  # the frame that tasks use by default, if known
    # inertias of the rotors by joint [kg·m² or kg], if the robot's folder has them;
    # used where they are requested
    motor_inertia: Mapping[str, float] = field(default_factory=dict)
    # joint values of a good start posture, shape (nv,) [rad or m], if known
    home: tuple[float, ...] | None = None
    posture: str | None = None  # name of the reference posture in the SRDF, if known
    # which coordinates theta = A q the literature uses for this robot (``absolute`` for
    # the planar arm), if not q
    joint_coordinates: str | None = None
    access: Access = ANYWHERE  # which files its URDF may name
    # the shapes of its bodies, if they are not in a URDF
    shapes: tuple[BodyShape, ...] | None = field(default=None, repr=False)
    # pairs of bodies that never collide, besides those of the SRDF
    excluded: frozenset[frozenset[str]] = frozenset()
    # features of the original model that the robot lacks, in words
    omitted: tuple[str, ...] = ()
    # the URDF that xacro makes of the file; None if the file is the URDF
    expanded: str | None = None
    # the meshes of a log, by their names in the URDF
    meshes: tuple[tuple[str, Path], ...] = field(default=(), repr=False)


def find_robot(
    name: str | Path,
    access: Access = ANYWHERE,
    xacro_args: Mapping[str, str] | None = None,
) -> RobotSource:
    """Find a bundled robot, one of an installed package, or a URDF or xacro file.

    A name with a path separator, or with the ending of a URDF or xacro file, is a path.
    """
    text = os.fspath(name)
    if is_path(text):
        return _from_path(Path(text), access, xacro_args)
    if text.endswith("_description"):
        return find_description(text, access, xacro_args)
    if xacro_args:
        raise ModelError(f"xacro_args: {text} is no xacro file")
    bundled = bundled_robots()
    if text in bundled:
        return _from_bundle(text, bundled[text])
    others = example_robots()
    if text in others:
        return others[text]
    if text in examples_without_urdf():
        raise RobotNotFoundError(
            f"robot {text!r} of example-robot-data has no URDF; robots can only be "
            "loaded from a URDF"
        )
    if text and is_folder(Path(text)):
        return _from_path(Path(text), access, xacro_args)  # which reports its contents
    known = [*bundled, *sorted(set(others) - set(bundled)), *_described_names()]
    hint = (
        "list all with: hsp robots"
        if others
        else "for 70 more: pip install example-robot-data-loaders"
    )
    raise RobotNotFoundError(
        f"no robot {text!r}{did_you_mean(text, known)} "
        f"(give a path to a .urdf file, or one of: {listing(known)}); {hint}"
    )


def find_description(
    name: str, access: Access = ANYWHERE, xacro_args: Mapping[str, str] | None = None
) -> RobotSource:
    """Find a robot of the package robot_descriptions, such as ``gen3_description``.

    Its repository is cloned if it is not yet there.
    """
    if access.strict:
        raise AccessError(
            f"robot {name!r}: strict reading allows no robot of robot_descriptions, "
            "because it may be fetched from a network"
        )
    if importlib.util.find_spec(PACKAGE) is None:
        raise RobotNotFoundError(
            f"robot {name!r} is described by the package {PACKAGE}: "
            f"pip install {PACKAGE}"
        )
    known = _described_names()
    if name not in known:
        raise RobotNotFoundError(
            f"{PACKAGE} has no URDF of {name!r}{did_you_mean(name, known)} "
            f"(it has {listing(known)})"
        )
    try:
        with redirect_stdout(sys.stderr):  # it prints there which repository it clones
            own = vars(import_module(f"{PACKAGE}.{name}"))
    except Exception as error:  # of git, or of a repository that has moved
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RobotNotFoundError(
            f"{PACKAGE} cannot fetch {name!r}: {reason}"
        ) from error
    file = Path(own.get("URDF_PATH") or own["XACRO_PATH"])
    package, repository = Path(own["PACKAGE_PATH"]), Path(own["REPOSITORY_PATH"])
    others = map(Path, own.get("XACRO_PACKAGE_PATHS", {}).values())
    places = [package, repository, package.parent, repository.parent, file.parent]
    folders = tuple(dict.fromkeys([*places, *(other.parent for other in others)]))
    defaults = {key: str(value) for key, value in own.get("XACRO_ARGS", {}).items()}
    return RobotSource(
        name=name,
        urdf=file,
        srdf=Path(own["SRDF_PATH"]) if "SRDF_PATH" in own else None,
        package_dirs=folders,
        origin="robot_descriptions",
        expanded=_expanded(file, access, folders, xacro_args, defaults),
    )


def _described_names() -> tuple[str, ...]:
    """Return the robots of robot_descriptions with a URDF; empty without it."""
    if importlib.util.find_spec(PACKAGE) is None:
        return ()
    known = import_module(PACKAGE).DESCRIPTIONS
    return tuple(name for name, about in known.items() if about.has_urdf)


def is_path(name: str) -> bool:
    """Return whether the name of a robot is a path."""
    return name.endswith(FILE_ENDINGS) or os.sep in name


def is_robot(name: str) -> bool:
    """Return whether a name is that of a robot, or of a URDF or xacro file."""
    known = {*bundled_robots(), *example_robots(), *_described_names()}
    return name in known or name.endswith((".urdf", ".xacro"))


def example_robots() -> dict[str, RobotSource]:
    """Return the robots of example-robot-data by name; empty if it is not installed."""
    loaders = _example_loaders()
    root = _example_data()
    if not loaders:
        return {}
    if root is None:
        raise RobotNotFoundError(
            "example-robot-data is installed without its robots; "
            "reinstall it with: pip install --force-reinstall example-robot-data"
        )
    sources = {}
    for name, loader in loaders.items():
        folder = root / "robots" / loader.path
        urdf = folder / loader.urdf_subpath / getattr(loader, "urdf_filename", "")
        srdf = folder / loader.srdf_subpath / getattr(loader, "srdf_filename", "")
        if urdf.is_file():
            sources[name] = RobotSource(
                name=name,
                urdf=urdf,
                srdf=srdf if srdf.is_file() else None,
                root="free_flyer" if loader.free_flyer else "fixed",
                package_dirs=(root.parent, root / "robots"),
                origin="example-robot-data",
                posture=loader.ref_posture if loader.free_flyer else None,
                end_effector=_END_EFFECTORS.get(name),
            )
    return sources


def examples_without_urdf() -> tuple[str, ...]:
    """Return the names of robots in example-robot-data that have no URDF."""
    found = example_robots()
    return tuple(name for name in _example_loaders() if name not in found)


def packaged_folders() -> list[Path]:
    """Return the folder of example-robot-data, or nothing if it is not installed."""
    folder = _example_data()
    return [] if folder is None else [folder]


def _expanded(
    file: Path,
    access: Access,
    folders: tuple[Path, ...],
    arguments: Mapping[str, str] | None,
    defaults: Mapping[str, str] | None = None,
) -> str | None:
    """Return the URDF that xacro makes of a file; None if it is no xacro file."""
    if is_xacro(file):
        if access.strict:
            raise AccessError(
                f"robot {str(file)!r}: strict reading allows no xacro file, because it "
                "is a program; expand it first"
            )
        return expand(file, arguments or {}, folders, defaults)
    if arguments:
        raise ModelError(f"xacro_args: {file} is no xacro file")
    return None


def _from_path(
    path: Path, access: Access, xacro_args: Mapping[str, str] | None
) -> RobotSource:
    if "\0" in str(path):
        raise RobotNotFoundError(
            f"{str(path)!r}: a path cannot contain a null character"
        )
    with suppress(RuntimeError):  # an unknown user: reported below as "no such file"
        path = path.expanduser()
    access.check(path, "robot")
    try:
        check_ends(path)
    except OSError as error:  # the name is too long, or its folder may not be read
        raise RobotNotFoundError(f"{path!s:.200}: {error.strerror}") from None
    if path.is_dir():
        robots = sorted(file.name for file in path.glob("*") if is_path(file.name))
        raise RobotNotFoundError(
            f"{path} is a folder; give a .urdf file in it"
            f" (it contains {listing(robots) or 'none'})"
        )
    if not path.is_file():
        near = sorted(file.name for file in path.parent.glob("*.urdf"))
        raise RobotNotFoundError(f"{path}: no such file{did_you_mean(path.name, near)}")
    # The folder of `package://<folder>/...` is usually one above the URDF.
    above = tuple(path.resolve().parents)[:5]
    allowed = tuple(folder for folder in above if access.allows(folder))
    name = Path(path.name.removesuffix(".xacro")).stem
    srdf = path.with_name(f"{name}.srdf")
    return RobotSource(
        name=name,
        urdf=path,
        srdf=srdf if is_file(srdf) and access.allows(srdf) else None,
        package_dirs=allowed,
        access=access,
        expanded=_expanded(path, access, allowed, xacro_args),
    )


def _from_bundle(name: str, folder: Path) -> RobotSource:
    settings: dict[str, Any] = {}
    file = folder / "robot.yaml"
    if file.is_file():
        settings = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
    home = settings.get("home")
    return RobotSource(
        name=name,
        urdf=folder / f"{name}.urdf",
        srdf=srdf if (srdf := folder / f"{name}.srdf").is_file() else None,
        package_dirs=(folder.parent, *(each.parent for each in packaged_folders())),
        origin="bundled",
        locked=dict(settings.get("locked") or {}),
        end_effector=settings.get("end_effector"),
        home=tuple(float(x) for x in home) if home is not None else None,
        motor_inertia=dict(settings.get("motor_inertia") or {}),
        joint_coordinates=settings.get("joint_coordinates"),
    )


def _example_loaders() -> dict[str, Any]:
    if importlib.util.find_spec("example_robot_data") is None:
        return {}
    from example_robot_data.robots_loader import ROBOTS

    return dict(ROBOTS)


def _example_data() -> Path | None:
    """Return ``<prefix>/share/example-robot-data`` of the installed package, if any."""
    spec = importlib.util.find_spec("example_robot_data")
    above = Path(spec.origin or "").parents if spec is not None else ()
    places = (parent / "share" / "example-robot-data" for parent in above)
    return next((folder for folder in places if folder.is_dir()), None)
