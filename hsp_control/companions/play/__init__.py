"""A robot to play with: a simulation in real time that a page steers."""

from .picture import Picture as Picture
from .real_time import play as play
from .session import Session as Session
