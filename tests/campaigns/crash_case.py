"""Misbehave in a way given by the case's number: the harness has to detect it."""

import os
import time


def case(seed: int, index: int) -> list[str]:
    """Abort, hang, raise, or succeed."""
    match index:
        case 0:
            os.abort()
        case 1:
            time.sleep(60.0)
        case 2:
            raise RuntimeError("unforeseen")
    return ["fine", ""]
