"""Estimation: where a floating base is, from what can be measured on board."""

from .base_estimator import BaseEstimator as BaseEstimator
from .base_estimator import RunningEstimator as RunningEstimator
from .contact_observer import ContactObserver as ContactObserver
from .contact_observer import RunningContactObserver as RunningContactObserver
