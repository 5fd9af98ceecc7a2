"""Sensors: they turn the true state into the measured one."""

from .differenced_velocity import DifferencedVelocity as DifferencedVelocity
from .encoder import Encoder as Encoder
from .imu import Imu as Imu
from .imu import RunningImu as RunningImu
from .position_noise import PositionNoise as PositionNoise
from .sensor import Sensing as Sensing
from .sensor import Sensor as Sensor
from .sensor import Sensors as Sensors
from .sensor_delay import SensorDelay as SensorDelay
from .velocity_noise import VelocityNoise as VelocityNoise
