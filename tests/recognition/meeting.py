"""A plausible meeting of a robot with some people, without end: what recognition is told of it, in order.

Nobody reacts to anybody: people look about, speak, nod, point and move objects at rates like those of the canapé
study, and the robot performs one block after the other. For benchmarks and tests of what is kept.
"""

import random
from collections.abc import Iterator
from heapq import merge
from itertools import count
from typing import Literal

from engage_hri.schemas.behaviors import Action, TurnSignal
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import SignalTurn
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.session import Observation
from tests.recognition.observations import PIECES, ROBOT, request_event, stamp, world

Observed = Iterator[tuple[Seconds, Observation]]
SYNC_POINTS = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
WORLD_EVERY: Seconds = 1.0
EVERY: dict[Action, Seconds] = {"look": 4.0, "speak": 12.0, "nod": 15.0, "shake": 60.0, "point": 30.0, "act": 40.0}
"""Mean pause of a person before doing it (again)."""
LASTING: dict[Action, tuple[Seconds, Seconds]] = {
    "speak": (0.2, 3.0), "nod": (0.4, 1.0), "shake": (0.4, 1.0), "point": (0.5, 2.0), "act": (1.0, 8.0),
}  # fmt: skip
AWAY_EVERY: Seconds = 300.0


def meeting(people: int, seed: int = 1) -> Observed:
    """What is observed of `people` persons and the robot from 0 s on."""
    names = tuple(f"person-{number}" for number in range(people))
    processes = [_world(names), _robot(names, random.Random(f"{seed} robot"))]
    for name in names:
        processes += [_acts(name, action, random.Random(f"{seed} {name} {action}")) for action in LASTING]
        processes += [_looks(name, random.Random(f"{seed} {name}")), _presence(name, random.Random(seed))]
    return merge(*processes, key=lambda observed: observed[0])


def _world(names: tuple[str, ...]) -> Observed:
    for tick in count():
        yield tick * WORLD_EVERY, world(*names)


def _looks(name: str, chance: random.Random) -> Observed:
    at, place = 0.0, ""
    while True:
        at += chance.expovariate(1 / EVERY["look"])
        before, place = place, chance.choice((ROBOT, ROBOT, ROBOT, *PIECES, "table", ""))
        if before:
            yield at, ActionEnded(actor=name, action="look", at=stamp(at), targets=(before,))
        if place:
            yield at, ActionBegan(actor=name, action="look", at=stamp(at), targets=(place,))


def _acts(name: str, action: Action, chance: random.Random) -> Observed:
    at = 0.0
    while True:
        at += chance.expovariate(1 / EVERY[action])
        targets = (chance.choice(PIECES),) if action in ("point", "act") else ()
        yield at, ActionBegan(actor=name, action=action, at=stamp(at), targets=targets)
        at += chance.uniform(*LASTING[action])
        yield at, ActionEnded(actor=name, action=action, at=stamp(at), targets=targets)


def _presence(name: str, chance: random.Random) -> Observed:
    at = 0.0
    while True:
        at += chance.expovariate(1 / AWAY_EVERY)
        yield at, ActorLost(actor=name, at=stamp(at))
        at += chance.uniform(0.1, 20.0)
        yield at, ActorFound(actor=name, at=stamp(at))


def _robot(names: tuple[str, ...], chance: random.Random) -> Observed:
    """Blocks one after the other: a look at a piece, with words that ask for an answer, and back to the face."""
    at = 0.5
    for number in count():
        block, turn, name = f"block-{number}", f"turn-{number}", chance.choice(names)
        for when, observation in _block(block, turn, name, chance, at):
            at = when
            yield when, observation
        at += chance.uniform(2.0, 12.0)


def _block(block: str, turn: str, name: str, chance: random.Random, at: Seconds) -> Observed:
    piece = chance.choice(PIECES)
    answer = chance.choice(((), (), ("act",)))

    def looks(kind: type[ActionBegan | ActionEnded], target: str) -> Observation:
        return kind(actor=ROBOT, action="look", at=stamp(at), targets=(target,), behavior=f"{block}:gaze-1")

    def speaks(kind: type[ActionBegan | ActionEnded]) -> Observation:
        return kind(actor=ROBOT, action="speak", at=stamp(at), behavior=f"{block}:speech-1")

    def passes(behavior: str, sync: str) -> Observation:
        return SyncPointProgress(block=block, behavior=behavior, sync=sync, at=stamp(at), time=at)

    yield at, BlockProgress(block=block, progress="start", at=stamp(at))
    yield at, HeadOwner(owner=Claim(kind="fragment", priority=3, target=piece), since=stamp(at))
    yield at, speaks(ActionBegan)
    yield at, passes("speech-1", "start")
    yield at, request_event("adjacency_pair", at, request=f"{block}/ap", block=block, responder=name, turn=turn,
                            accept=answer)  # fmt: skip
    yield at, request_event("directed_gaze", at, piece, request=f"{block}/dg", block=block, responder=name,
                            turn=turn, cause="reference", anchors=("gaze-1:stroke", "speech-1:start"))  # fmt: skip
    for sync in SYNC_POINTS:
        at += 0.12
        yield at, passes("gaze-1", sync)
        if sync == "stroke":
            yield at, looks(ActionBegan, piece)
    yield at, looks(ActionEnded, piece)
    at += chance.uniform(0.3, 1.0)
    yield at, HeadOwner(owner=Claim(kind="face", priority=2, target=name), since=stamp(at))
    yield at, request_event("mutual_facial_gaze", at, request=f"{block}/mfg", block=block, responder=name, turn=turn,
                            cause=chance.choice(("turn", "maintenance")))  # fmt: skip
    at += 0.3
    yield at, looks(ActionBegan, name)
    at += chance.uniform(0.1, 1.0)
    yield at, speaks(ActionEnded)
    yield at, passes("speech-1", "end")
    signal = TurnSignal(id="turn-end", turn=turn, signal="ended", actor=name)
    yield at, SignalTurn(id=f"{block}/end", requester="realizer", signal=signal, at=stamp(at), block=block)
    status: Literal["done", "interrupted"] = chance.choice(("done", "done", "done", "interrupted"))
    yield at, BlockProgress(block=block, progress="end", at=stamp(at), status=status)
