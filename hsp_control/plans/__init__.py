"""Plans: what a robot is to do, decided once a period from what is measured."""

from .crawling import Crawl as Crawl
from .plan import Plan as Plan
from .plan import PlanParts as PlanParts
from .plan import RunningPlan as RunningPlan
from .sensing import Sensed as Sensed
from .sensing import SensedContact as SensedContact
from .trotting import Trot as Trot
from .walking import Walk as Walk
