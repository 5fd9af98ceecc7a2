"""Estimation: what is not measured of a robot, from what is."""

from .base_estimator import BaseEstimator as BaseEstimator
from .contact_forces import ContactForces as ContactForces
from .estimator import Estimator as Estimator
from .estimator import Estimators as Estimators
from .estimator import RunningEstimator as RunningEstimator
from .estimator import begun as begun
