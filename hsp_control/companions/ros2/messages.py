"""The messages of ROS 2 that are sent and received here, with ROS 2's own layouts.

On the wire, ROS 2's ``sensor_msgs/msg/JointState`` is the DDS type
``sensor_msgs::msg::dds_::JointState_``. Its bytes are plain CDR (XCDR1), in the order
of the fields. ROS 2's repositories common_interfaces and rcl_interfaces describe them.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, uint32

if TYPE_CHECKING:
    from builtins import list as sequence  # which Cyclone does not declare
else:
    from cyclonedds.idl.types import sequence

BILLION = 1_000_000_000
"""Nanoseconds in a second."""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """A time since 1970, or since a simulation began [s, ns]."""

    sec: int32
    nanosec: uint32

    @classmethod
    def of(cls, nanoseconds: int) -> "Time":
        """Return the time of a number of nanoseconds."""
        sec, nanosec = divmod(nanoseconds, BILLION)
        return cls(sec, nanosec)

    @property
    def nanoseconds(self) -> int:
        """The time as one number [ns]."""
        return self.sec * BILLION + self.nanosec


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """The time and the frame of a measurement."""

    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Positions [rad or m], velocities and efforts of joints, by name."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class MultiArrayDimension(
    IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"
):
    """A dimension of an array; unused, as in ros2_control's commands."""

    label: str
    size: uint32
    stride: uint32


@dataclass
class MultiArrayLayout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    """The dimensions of an array; empty for a vector."""

    dim: sequence[MultiArrayDimension] = field(default_factory=list)
    data_offset: uint32 = uint32(0)  # noqa: RUF009 (a number)


@dataclass
class Float64MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):
    """Numbers; ros2_control's commands to a group of joints."""

    layout: MultiArrayLayout
    data: sequence[float64]


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    """A point [m]."""

    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """An orientation."""

    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    """A position and an orientation."""

    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    """A pose at a time, in a frame."""

    header: Header
    pose: Pose


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """A vector."""

    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """A linear and an angular velocity [m/s, rad/s]."""

    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    """A twist at a time, in a frame."""

    header: Header
    twist: Twist


TYPE_HASHES: dict[type[IdlStruct], str] = {
    JointState: "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    Float64MultiArray: (
        "1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f"
    ),
    PoseStamped: "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    TwistStamped: "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
}
"""The hashes (RIHS01) by which ROS 2 since Iron distinguishes types. ROS 2 does not
compare them over DDS, but warns if one is missing."""


def ros_name(typename: str) -> str:
    """Return ROS 2's name of a DDS type, such as ``sensor_msgs/msg/JointState``."""
    return typename.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
