"""What a plan, an estimator or another part of its own may know of this room.

Walking imports from nowhere else here, and so a contract keeps it: what is not named
below may move. A `MotionPlan` gives a controller its tasks and contacts step by step,
an `Estimator` the state that it computes with; both read a `Measurement`, write
`LogChannel` columns, and may ask a `FallDetector` or a `RunningObserver`.
"""

from .compensation.momentum_observer import RunningObserver as RunningObserver
from .controller import Controller as Controller
from .estimator import Estimator as Estimator
from .estimator import RunningEstimator as RunningEstimator
from .falling import FallDetector as FallDetector
from .measurement import Inertial as Inertial
from .measurement import LogChannel as LogChannel
from .measurement import Measurement as Measurement
from .motion_plan import MotionPlan as MotionPlan
from .motion_plan import PlanParts as PlanParts
from .motion_plan import RunningPlan as RunningPlan
from .planned import HELD as HELD
