"""Inject packet loss, delay, duplication and corruption, and count them."""

from collections import Counter
from dataclasses import asdict, dataclass, fields

import numpy as np

from hsp_control.common.exceptions import LiveError
from hsp_control.common.suggestions import did_you_mean


@dataclass(frozen=True)
class Faults:
    """Probabilities of packet faults; a packet has one fault at most.

    Attributes:
        late: Probability that a packet is sent after some later ones.
        lost: Probability that it is not sent.
        duplicated: Probability that it is sent twice.
        corrupted: Probability that one of its bits is inverted.
        delay: Number of packets that are sent before a late one.
        seed: Seed of the random numbers.
    """

    late: float = 0.0
    lost: float = 0.0
    duplicated: float = 0.0
    corrupted: float = 0.0
    delay: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        for name in _KINDS:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise LiveError(
                    f"{name} is {getattr(self, name)}; needs a probability, 0 to 1"
                )
        if sum(getattr(self, name) for name in _KINDS) > 1.0 + 1e-12:
            raise LiveError("the probabilities of the faults add up to more than 1")
        if self.delay < 1:
            raise LiveError(f"delay is {self.delay}; needs at least 1 packet")

    @classmethod
    def parse(cls, text: str) -> "Faults":
        """Parse a text such as ``late=0.01,lost=0.02,seed=3``.

        Raises:
            LiveError: If a name is unknown, or a value is not a valid number.
        """
        known = {field.name: field.type for field in fields(cls)}
        values: dict[str, float | int] = {}
        for part in filter(None, text.split(",")):
            name, _, number = (piece.strip() for piece in part.partition("="))
            if name not in known:
                raise LiveError(
                    f"no fault {name!r}{did_you_mean(name, known)} "
                    f"(there are {', '.join(known)})"
                )
            try:
                kind = int if name in {"delay", "seed"} else float
                values[name] = kind(number)
            except ValueError:
                raise LiveError(
                    f"fault {name} is {number!r}; needs a number, as {name}=0.01"
                ) from None
        return cls(**values)  # type: ignore[arg-type]

    def as_json(self) -> dict[str, float]:
        """Return the settings as JSON data."""
        return asdict(self)


_KINDS = ("late", "lost", "duplicated", "corrupted")


class FaultInjector:
    """Applies `Faults` to packets."""

    def __init__(self, faults: Faults, stream: int = 0) -> None:
        self._faults = faults
        self._rng = np.random.default_rng((faults.seed, stream))
        self._cumulative = np.cumsum([getattr(faults, kind) for kind in _KINDS])
        self._waiting: list[tuple[int, bytes]] = []
        # number of injected faults of each kind
        self.injected: Counter[str] = Counter(dict.fromkeys(_KINDS, 0))

    def apply(self, data: bytes) -> list[bytes]:
        """Return the packets to send now in place of this one, in order."""
        released = [late for left, late in self._waiting if left <= 1]
        self._waiting = [(left - 1, late) for left, late in self._waiting if left > 1]
        which = int(np.searchsorted(self._cumulative, self._rng.random(), side="right"))
        if which == len(_KINDS):
            return [data, *released]
        kind = _KINDS[which]
        self.injected[kind] += 1
        if kind == "late":
            self._waiting.append((self._faults.delay, data))
            return released
        if kind == "lost":
            return released
        if kind == "duplicated":
            return [data, data, *released]
        corrupted = bytearray(data)
        bit = int(self._rng.integers(8 * len(data)))
        corrupted[bit // 8] ^= 1 << (bit % 8)
        return [bytes(corrupted), *released]

    def flush(self) -> list[bytes]:
        """Return the late packets that still wait, before the last packet is sent."""
        waiting, self._waiting = self._waiting, []
        return [data for _, data in waiting]
