"""DDS on the loopback interface, isolated between test processes."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from threading import Event, Thread

from live_rigs import start
from loaded_robots import panda

from hsp_control.companions.ros2.messages import BILLION, Header, JointState, Time
from hsp_control.companions.ros2.node import Node, TopicPublisher

LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces>"
    "<NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery>"
    "<ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>40</MaxAutoParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
"""Discovery without multicast, which containers seldom have."""
os.environ["CYCLONEDDS_URI"] = LOOPBACK
DOMAIN = 1 + os.getpid() % 200
MILLISECOND = BILLION // 1000
_numbers = count()


def fresh() -> tuple[str, str, str]:
    """Return unique topic names: controller, states, and their address."""
    name = f"t{os.getpid()}_{next(_numbers)}"
    states = f"/{name}/joint_states"
    return f"/{name}", states, f"{name}?states={states}&domain={DOMAIN}"


@contextmanager
def client(out: Path, *words: object) -> Iterator[subprocess.Popen[bytes]]:
    """Run the plain client, see `dds_client`; it must end by itself."""
    script = Path(__file__).with_name("dds_client.py")
    command = [sys.executable, str(script), *map(str, words)]
    environment = {**os.environ, "PYTHONPATH": ""}
    with out.open("wb") as file:  # not a pipe: a full one would block it
        process = subprocess.Popen(command, stdout=file, env=environment)
    try:
        yield process
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.wait()


def joint_state(
    stamp: int,
    names: tuple[str, ...] | None = None,
    q: list[float] | None = None,
    v: list[float] | None = None,
) -> JointState:
    """Return a state of a resting Panda, or of other joints."""
    names = panda().dof_names if names is None else names
    q = start().tolist() if q is None else q
    v = [0.0] * len(names) if v is None else v
    return JointState(Header(Time.of(stamp), ""), list(names), q, v, [])


class Broadcaster:
    """Publishes states in a thread until it is stopped.

    Attributes:
        stamp: The stamp of the last state [ns].
        publisher: Where they are published.
    """

    def __init__(
        self, states: str, *, step: int = MILLISECOND, **message: object
    ) -> None:
        self.publisher: TopicPublisher[JointState]
        self.publisher = Node(DOMAIN).publisher(states, JointState)
        self.stamp, self._step, self._message = BILLION, step, message
        self._still = Event()
        self._thread = Thread(target=self._run)

    def send(self, **message: object) -> None:
        """Publish the next state."""
        self.stamp += self._step
        given = {**self._message, **message}
        self.publisher.send(joint_state(self.stamp, **given))  # type: ignore[arg-type]

    def _run(self) -> None:
        while not self._still.wait(0.001):
            self.send()

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Publish a state per millisecond."""
        self._thread.start()
        try:
            yield
        finally:
            self._still.set()
            self._thread.join()
