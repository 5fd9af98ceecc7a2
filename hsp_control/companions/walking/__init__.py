"""Walking: plans for two feet and four, and the estimators of a floating base."""

from .crawling import Crawl as Crawl
from .estimation.base_estimator import BaseEstimator as BaseEstimator
from .estimation.contact_forces import ContactForces as ContactForces
from .sensed_contacts import Sensed as Sensed
from .sensed_contacts import SensedContact as SensedContact
from .trotting import Trot as Trot
from .walking import Walk as Walk
