"""The interface of `control` for companions.

They import from no other module here, by a contract: names that are not listed below
may change. A `MotionPlan` gives a controller its tasks and contacts step by step, an
`Estimator` the state that it computes with; both read a `Measurement`, write
`LogChannel` columns, and may use a `FallDetector` or a `RunningObserver`. Pages steer a
`Controller` by `Changes` and streams, and draw its output.
"""

from .active_stack import ActiveStack as ActiveStack
from .changes import Change as Change
from .changes import Changes as Changes
from .compensation import CompensatedController as CompensatedController
from .compensation import Compensation as Compensation
from .compensation.automatic_observer import largest_cancelled as largest_cancelled
from .compensation.momentum_observer import MomentumObserver as MomentumObserver
from .compensation.momentum_observer import RunningObserver as RunningObserver
from .controller import Controller as Controller
from .estimation import Estimator as Estimator
from .estimation import RunningEstimator as RunningEstimator
from .falling import FallDetector as FallDetector
from .first_state import StartWarning as StartWarning
from .measurement import NO_WRENCHES as NO_WRENCHES
from .measurement import Inertial as Inertial
from .measurement import LogChannel as LogChannel
from .measurement import Measurement as Measurement
from .output import ControlOutput as ControlOutput
from .planned import HELD as HELD
from .plans import MotionPlan as MotionPlan
from .plans import PlanParts as PlanParts
from .plans import RunningPlan as RunningPlan
from .targets import DELAY as DELAY
from .targets import RAMP as RAMP
from .targets import new_stream as new_stream
