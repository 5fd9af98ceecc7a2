"""The process that holds the connection to a Franka arm; started by `ClientProcess`.

libfranka waits for ever for an answer when the control box closes the connection inside
a command, and pylibfranka keeps the interpreter's lock while it waits, so that no
thread of the same process could help. Its destructors may end the process. So it runs
here, where the loop can kill it.

It executes one request at a time, and imports nothing of hsp_control: it starts fast.
Given an address to listen at, it drives the gripper instead.
"""

import gc
import json
import os
import socket
import struct
import sys
from contextlib import suppress
from select import select
from time import monotonic
from typing import Any

REQUEST = struct.Struct("=c7d")
"""A letter, and seven efforts [N·m] for ``E`` and ``F``."""
STATE = struct.Struct("=cd7d7d7d")
"""``S``; time [s]; q [rad]; dq [rad/s]; tau_J_d [N·m]."""

CONNECT, READ, START, EFFORT, FINISH = b"C", b"R", b"S", b"E", b"F"
ANSWER, ERROR = b"A", b"X"
LONGEST = 1 << 16
"""Longest message [bytes]."""
SPEED, FORCE = 0.1, 30.0
"""Speed [m/s] and grasping force [N] of the gripper."""
_SAME = 0.001
"""Difference below which two openings of a finger are equal [m]."""
_SILENCE = 2.0
"""Silence after which another sender is accepted [s]."""
ALIVE = b"L"
"""Unsolicited messages of the gripper's process while it runs."""
_BEAT = 0.5
"""Time between two of these [s]; a motion of the fingers takes longer."""


class Client:
    """Answers requests with pylibfranka."""

    def __init__(self) -> None:
        """Wait for the first request."""
        self.fingers: GripperClient | None = None
        self.library: Any = None
        self.robot: Any = None
        self.control: Any = None

    def answer(self, message: bytes) -> bytes:
        """Return the answer to a request, a state or a text; errors are answers too."""
        kind = message[:1]
        try:
            if kind == EFFORT:
                self.write(message)
                return packed(self.control.readOnce()[0])
            if kind == READ:
                return packed(self.robot.read_once())
            if kind == START:
                self.control = self.robot.start_torque_control()
                return packed(self.control.readOnce()[0])
            if kind == FINISH:
                self.write(message, finished=True)
                return ANSWER + b"{}"
            return ANSWER + json.dumps(self.connect(json.loads(message[1:]))).encode()
        except Exception as error:
            answer = {"kind": type(error).__name__, "text": str(error)}
            return ERROR + json.dumps(answer).encode()

    def connect(self, wanted: dict[str, Any]) -> dict[str, Any]:
        """Connect, apply the settings, and return the robot's state and model."""
        if (listens := wanted.get("gripper")) is not None:
            self.fingers = GripperClient(wanted["address"], *listens)
            return {"value": self.fingers.opening}
        import pylibfranka

        self.library = pylibfranka
        config = pylibfranka.RealtimeConfig
        realtime = config.kEnforce if wanted["enforce"] else config.kIgnore
        self.robot = pylibfranka.Robot(wanted["address"], realtime)
        state = self.robot.read_once()
        if state.robot_mode == pylibfranka.RobotMode.Reflex and wanted["recover"]:
            self.robot.automatic_error_recovery()
            state = self.robot.read_once()
        if state.robot_mode != pylibfranka.RobotMode.Idle:
            return described(state)
        if wanted["collision"] is not None:
            torque, force = wanted["collision"]
            self.robot.set_collision_behavior(torque, torque, force, force)
        if (load := wanted["load"]) is not None:
            self.robot.set_load(load["mass"], load["center"], load["inertia"])
            state = self.robot.read_once()
        model = self.robot.load_model()
        masses, gravities = [], []
        measured = list(state.q)
        for q in [measured, *wanted["postures"]]:
            state.q = q
            masses.append(list(model.mass(state)))
            gravities.append(list(model.gravity(state)))
        state.q = measured
        return {**described(state), "masses": masses, "gravities": gravities}

    def write(self, message: bytes, finished: bool = False) -> None:
        """Send a request's effort, which may be the last one."""
        torques = self.library.Torques(list(REQUEST.unpack(message)[1:]))
        torques.motion_finished = finished
        self.control.writeOnce(torques)


def packed(state: Any) -> bytes:
    """Return a state as a message."""
    return STATE.pack(b"S", state.time.to_sec(), *state.q, *state.dq, *state.tau_J_d)


def described(state: Any) -> dict[str, Any]:
    """Return the values of a state that are logged once: mode, errors, flange load."""
    errors = state.current_errors
    names = [name for name in dir(errors) if not name.startswith("_")]
    return {
        "mode": state.robot_mode.name,
        "errors": [name for name in names if getattr(errors, name)],
        "q": list(state.q),
        "end_effector": state.m_ee,
        "load": {
            "mass": state.m_load,
            "center": list(state.F_x_Cload),
            "inertia": list(state.I_load),
        },
        "total": {
            "mass": state.m_total,
            "center": list(state.F_x_Ctotal),
            "inertia": list(state.I_total),
        },
        "flange_to_end_effector": list(state.F_T_EE),
    }


class GripperClient:
    """Moves the gripper by JSON datagrams, ``{"value": [0.02]}``: a finger [m].

    Of messages during a motion the newest is used. A smaller opening grasps an object.
    The sender, also of a query ``{}``, receives its state.
    """

    def __init__(self, address: str, host: str, port: int) -> None:
        """Connect and listen."""
        import pylibfranka

        self.gripper: Any = pylibfranka.Gripper(address)
        self.opening: float = 0.5 * self.gripper.read_once().width
        self.inbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.inbox.bind((host, port))
        self.sender, self.last_time, self.last_line = ("", 0), -_SILENCE, ""
        self.last_beat = -_BEAT

    def serve(self, link: socket.socket) -> None:
        """Execute messages until the loop ends; the fingers then keep their opening."""
        while True:
            wanted, waiting, listeners = self.opening, _BEAT, set()
            self.beat(link)
            while ready := select([self.inbox, link], [], [], waiting)[0]:
                self.beat(link)
                if link in ready:
                    return
                try:
                    text, sender = self.inbox.recvfrom(LONGEST)
                except OSError:  # the listener is gone
                    continue
                if is_answer(text) or sender == self.inbox.getsockname():
                    continue  # our own message: answering it would not end
                listeners.add(sender)
                waiting = 0.0
                try:
                    wanted = self.read(json.loads(text), sender, wanted)
                except Exception as error:  # a datagram may contain anything
                    self.say(f"a message is dropped: {error}")
            if not listeners:
                continue
            try:
                self.move(wanted)
                state = self.gripper.read_once()
            except Exception as error:
                self.say(str(error))
                continue
            answer = {"value": [0.5 * state.width], "grasped": state.is_grasped}
            for listener in listeners:
                try:
                    self.inbox.sendto(json.dumps(answer).encode(), listener)
                except OSError as error:
                    self.say(f"{listener[0]}:{listener[1]} cannot be reached: {error}")

    def beat(self, link: socket.socket) -> None:
        """Report that this process is alive, unless the last report is unread."""
        if monotonic() - self.last_beat >= _BEAT:
            self.last_beat = monotonic()
            with suppress(OSError):
                link.send(ALIVE, socket.MSG_DONTWAIT)

    def read(self, message: Any, sender: tuple[str, int], wanted: float) -> float:
        """Return the opening that a message commands, if any."""
        if not isinstance(message, dict):
            raise ValueError("it needs a mapping with value: [OPENING]")
        value = message.get("value")
        if "values" in message:
            values = message["values"]
            if not isinstance(values, list) or not values:
                raise ValueError(f"values: {str(values)[:40]}; needs [[OPENING], ...]")
            value = values[-1]
        if value is None:
            return wanted
        if sender != self.sender and monotonic() - self.last_time < _SILENCE:
            known, other = (":".join(map(str, who)) for who in (self.sender, sender))
            raise ValueError(f"{other} is ignored while {known} sends")
        numbers = value if isinstance(value, list) else []
        if len(numbers) != 1 or type(numbers[0]) not in (int, float):
            raise ValueError(f"the value is {str(value)[:40]}; needs [OPENING]")
        if not 0.0 <= (opening := float(numbers[0])) <= 1.0:
            raise ValueError(f"the opening is {opening} m; needs 0 to 1")
        self.sender, self.last_time = sender, monotonic()
        return opening

    def move(self, opening: float) -> None:
        """Open, or close and grasp."""
        last = self.opening
        if abs(opening - last) > _SAME:
            if opening < last:
                self.gripper.grasp(2.0 * opening, SPEED, FORCE, 0.1, 0.1)
            else:
                self.gripper.move(2.0 * opening, SPEED)
            self.opening = opening  # a failed motion is tried again on command

    def say(self, line: str) -> None:
        """Print a line once."""
        if line != self.last_line:
            self.last_line = line
            shown = line.encode("ascii", "backslashreplace").decode()
            with suppress(OSError, ValueError):  # the standard output may be closed
                print(f"The gripper: {shown}", flush=True)


def is_answer(text: bytes) -> bool:
    """Return whether a datagram is an answer of a gripper."""
    try:
        message = json.loads(text)
    except Exception:  # `read` reports it
        return False
    return isinstance(message, dict) and "grasped" in message


def main(descriptor: int) -> None:
    """Answer requests from a socket until its other end is closed."""
    gc.disable()  # no reference cycles occur here
    link = socket.socket(fileno=descriptor)
    client = Client()
    while message := link.recv(LONGEST):
        link.send(client.answer(message))
        if client.fingers is not None:
            client.fingers.serve(link)
    os._exit(0)  # without libfranka's destructors, which may wait for ever


if __name__ == "__main__":
    main(int(sys.argv[1]))
