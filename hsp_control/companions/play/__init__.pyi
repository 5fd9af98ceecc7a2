from .real_time import play as play
from .session import Session as Session
