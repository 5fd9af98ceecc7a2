"""A swaying IMU above points that appear and vanish, and the filter that tracks it."""

from copy import deepcopy

import numpy as np
from scipy.linalg import expm

from hsp_control.companions.walking.estimation.invariant_filter import (
    Densities,
    InvariantFilter,
    skew,
)

GRAVITY = np.array([0.0, 0.0, -9.81])
DENSITIES = Densities(2e-3, 2e-2, 1e-3, 1e-2, 5e-3)
SEEN = 2e-3  # standard deviation of the leg kinematics [m]


class Walker:
    """A swaying IMU above points that appear and vanish, with known truth."""

    def __init__(self, random, h, densities, seen, noise=1.0):
        self.random, self.h, self.noise = random, h, noise
        self.slip, self.deviation = densities.slip, seen
        self.rotation, self.velocity = np.eye(3), np.array([0.3, 0.0, 0.0])
        self.position = np.array([0.0, 0.0, 0.8])
        self.places = {0: np.array([0.0, 0.1, 0.0]), 1: np.array([0.0, -0.1, 0.0])}
        n = densities
        self.walks = np.repeat([n.gyroscope_walk, n.accelerometer_walk], 3)
        self.whites = np.repeat([n.gyroscope, n.accelerometer], 3) / np.sqrt(h)
        self.bias = np.zeros(6)

    def draw(self, *shape):
        return self.noise * self.random.normal(size=shape)

    def step(self, t):
        """Advance; return the IMU's readings."""
        h = self.h
        omega = np.array([0.5 * np.sin(3 * t), 0.4 * np.cos(4 * t), 0.3 * np.sin(t)])
        force = self.rotation.T @ (
            np.array([np.sin(5 * t), np.cos(7 * t), 2 * np.sin(6 * t)]) - GRAVITY
        )
        acceleration = self.rotation @ force + GRAVITY
        self.position = self.position + h * self.velocity + 0.5 * h * h * acceleration
        self.velocity = self.velocity + h * acceleration
        self.rotation = self.rotation @ expm(h * skew(omega))
        readings = np.concatenate([omega, force]) + self.bias
        readings += self.whites * self.draw(6)
        self.bias = self.bias + np.sqrt(h) * self.walks * self.draw(6)
        for name in self.places:
            slip = np.sqrt(h) * self.slip * self.draw(3)
            self.places[name] = self.places[name] + slip
        return readings[:3], readings[3:]

    def seen(self, names):
        places = np.array([self.places[name] for name in names]).reshape(-1, 3)
        exact = (places - self.position) @ self.rotation
        return exact + self.deviation * self.draw(*exact.shape)

    def true(self, estimate):
        """Return the truth, with the points of an estimate."""
        found = deepcopy(estimate)
        found.rotation, found.velocity = self.rotation, self.velocity
        found.position = self.position
        found.points = np.array([self.places[n] for n in estimate.names]).reshape(-1, 3)
        found.gyroscope_bias, found.accelerometer_bias = self.bias[:3], self.bias[3:]
        return found


def walked(random, start, duration, densities=DENSITIES, seen=SEEN, noise=1.0):
    """Return a walker and the filter that tracked it; every step has new points.

    Args:
        random: The random numbers.
        start: Standard deviations of the error at the start, shape (15,).
        duration: Duration [s].
        densities: Noise densities assumed by the filter.
        seen: Standard deviation of leg kinematics assumed by the filter [m].
        noise: Factor of all noise of the readings.
    """
    h = 0.01
    walker = Walker(random, h, densities, seen, noise)
    walker.bias = -start[9:] * random.normal(size=6)
    estimate = InvariantFilter(
        walker.rotation,
        walker.velocity,
        walker.position,
        np.diag(start**2),
        densities,
        GRAVITY,
    )
    error = start * random.normal(size=15)
    error[9:] = 0.0  # the estimate is zero, the truth is not
    estimate.retract(error)
    names = [0, 1]
    estimate.add(names, walker.seen(names), seen**2 * np.eye(6))
    for k in range(round(duration / h)):
        estimate.predict(*walker.step(k * h), h)
        if k % 40 == 20:  # a foot lifts off, and lands elsewhere
            name = estimate.names[0]
            estimate.drop([name])
            walker.places[name] = walker.position * [1, 1, 0] + [0.2, 0.1, 0]
            left = list(estimate.names)
            estimate.correct(walker.seen(left), seen**2 * np.eye(3 * len(left)))
            estimate.add([name], walker.seen([name]), seen**2 * np.eye(3))
        else:
            names = list(estimate.names)
            estimate.correct(walker.seen(names), seen**2 * np.eye(3 * len(names)))
    return walker, estimate
