"""A command of ours that writes down what it tells, asks and sees: `python -m tests.lab.recorded FILE ARGUMENT...`.

What a process says on a network that is cut may be lost; its record is not. Each line of FILE is one event, with the
seconds of the host's monotonic clock: by so many seconds as `LAB_AHEAD` says, that of the machine is ahead of it.
"""

import json
import os
import sys
import time
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BodyHeld
from engage_hri.schemas.body import BehaviorOutcome, RobotState, WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.requests import Accepted, Outcome, Refused
from engage_hri.services.bus.zenoh.hub import ZenohHub
from engage_hri.services.bus.zenoh.links import RouterNews
from engage_hri.services.bus.zenoh.peers import Peers
from engage_hri.services.requests.ends import Pending, Requester

AHEAD = float(os.environ.get("LAB_AHEAD", "0"))
STILL = 0.02
"""Radians a second below which a joint counts as still."""


class Record:
    """The file of one process."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        self._process = os.urandom(8).hex()  # machines that boot again give the same numbers again
        self._state: RobotState | None = None
        self._moves = False

    def __call__(self, what: str, **fields: object) -> None:
        line = {"t": time.monotonic() - AHEAD, "process": self._process, "what": what, **fields}
        os.write(self._file, json.dumps(line).encode() + b"\n")

    def message(self, key: str, message: object) -> None:
        """Write down what is published, as far as anybody asks for it."""
        match message:
            case WordSpoken():
                self("word", block=message.block, behavior=message.behavior, at=message.at.seconds,
                     position=message.position, word=message.word)  # fmt: skip
            case BodyHeld(holds=holds):
                self("held", behaviors=[f"{each.block}:{each.behavior}" for each in holds],
                     why=[_why(each.why) for each in holds])  # fmt: skip
            case RobotState():
                self._motion(message)
            case Accepted() | Refused() | Outcome():
                status = getattr(message, "status", type(message).__name__)
                whose = (message.requester, message.life, message.kind, message.id)
                label = f"{message.block}:{message.behavior}" if isinstance(message, BehaviorOutcome) else ""
                label = message.fragment if isinstance(message, FragmentOutcome) else label
                self("answer", server=keys.server_of(key), whose="|".join(whose), status=status, label=label,
                     **_why(getattr(message, "fault", None)))  # fmt: skip

    def _motion(self, state: RobotState) -> None:
        before, self._state = self._state, state
        if before is None or (seconds := state.at.seconds - before.at.seconds) <= 0.0:
            return
        angles = {each.joint: each.angle for each in before.pose.joints}
        fastest = max((abs(each.angle - angles[each.joint]) for each in state.pose.joints), default=0.0) / seconds
        if (moves := fastest > STILL) != self._moves:
            self._moves = moves
            self("moves" if moves else "still", since=before.at.seconds)


def _why(fault: Fault | None) -> dict[str, str]:
    """What a fault says: `reason`, and of what kind it is, and who reports it."""
    if fault is None:
        return {"reason": "", "cause": "", "blamed": "", "speaker": ""}
    return {"reason": str(fault), "cause": fault.cause, "blamed": fault.whose, "speaker": fault.service}


def tap(record: Record) -> None:
    """Let the record hear all that this process publishes, asks, is told, whom it sees, and its links to routers."""
    publish, send, note = ZenohHub.publish, Requester.send, Peers.note
    came, went = RouterNews.came, RouterNews.went

    def publishing(hub: ZenohHub, bus: Any, key: str, message: Any) -> None:
        record.message(key, message)
        publish(hub, bus, key, message)

    def sending(
        requester: Requester, key: str, request: Any, within: float | None = None, tell: Any = None
    ) -> Pending:
        is_new = request.id not in requester._pending
        pending = send(requester, key, request, within, tell)
        if is_new:
            whose = f"{requester._bus.name}|{requester._life}|{request.__struct_config__.tag}|{request.id}"
            record("asked", whose=whose)

            def told(future: Any) -> None:
                if not future.cancelled():
                    error = future.exception()
                    told = f"{type(error).__name__}: {error}" if error else getattr(future.result(), "status", "")
                    record("told", whose=whose, told=told, **_why(getattr(error or future.result(), "fault", None)))

            pending.outcome.add_done_callback(told)
        return pending

    def noting(peers: Peers, part: keys.Part, name: str, run: str, there: bool) -> None:
        note(peers, part, name, run, there)
        record("sees" if name in peers.names else "misses", name=name)

    def coming(news: RouterNews, zid: str, endpoint: str, now: float) -> str | None:
        record("linked")
        return came(news, zid, endpoint, now)

    def going(news: RouterNews, zid: str, now: float) -> None:
        went(news, zid, now)
        if not news._here:
            record("unlinked")

    RouterNews.came, RouterNews.went = coming, going  # type: ignore[method-assign]
    ZenohHub.publish = publishing  # type: ignore[method-assign]
    Requester.send = sending  # type: ignore[method-assign]
    Peers.note = noting  # type: ignore[method-assign]


def main() -> None:
    """Run the command."""
    path, *arguments = sys.argv[1:]
    record = Record(path)
    tap(record)
    from engage_hri.services.commandline.app import main as engage

    record("began", arguments=arguments)
    engage(arguments)


if __name__ == "__main__":
    main()
