"""Plans: what a robot is to do, decided once a period from what is measured."""

from .crawl import Crawl as Crawl
from .plan import Plan as Plan
from .plan import PlanParts as PlanParts
from .plan import RunningPlan as RunningPlan
from .sensed import Sensed as Sensed
from .sensed import SensedContact as SensedContact
from .trot import Trot as Trot
from .walk import Walk as Walk
