"""An independent reader of what a robot did: from feedback, the body's log and the voice's words alone.

It takes nothing of generation, and nothing that computes summaries. Object, `by`, `looked`, `eye_contact`, `said` and
status are decided once more from what the realizer and recognition have told, from where the eyes and forearms of
the body really pointed at that instant, and from which programs were alive, for turns in worlds that change at
random. `python -m tests.generation.deeds --turns 10000` tries many, and prints each difference.
"""

import argparse
import asyncio
import math
import random
import sys
from collections.abc import Collection
from contextlib import AsyncExitStack, suppress
from itertools import combinations
from typing import Any

import msgspec

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

PLACES = ((0.5, 0.2, 0.8), (0.45, -0.2, 0.8), (0.6, 0.0, 0.8), (-1.0, 0.2, 0.8), (0.05, 0.0, 1.15), (3.0, 1.0, 0.5))
"""Places of objects: three within reach, one behind the robot, one above its shoulder, one far away."""
SERVICES = (*roster.ROBOT, "simulation")
DYING = ("generation", "realizer", "control", "recognition")
STARTED_AGAIN = 20.0
"""Seconds after which a program that has died runs again, if its turn still goes on."""
LAST_WORDS = ("itisverynice", "now")
"""Letters of the last words of a call, and of a stream."""
SAMPLE = 0.06
"""Seconds from an instant within which the body's log has a sample."""
SEEN = 1.0
"""Seconds for which a gesture that is under way may still go to where its object was."""
WIDEST = {"pointing": 12.0, "a look": 6.0}
"""Degrees that a gesture may miss its object by."""
Vector = tuple[float, float, float]


class Reader:
    """What was seen on the bus, as plain values."""

    def __init__(self) -> None:
        self.points: dict[tuple[str, str, str], float] = {}
        """When each sync point came the last time."""
        self.ends: dict[str, list[str]] = {}
        """The ends of the blocks of each name, in order; the last is empty while it goes on."""
        self.words: list[tuple[str, str, str, float]] = []
        self.events: dict[str, dict[str, Any]] = {}
        self.places: list[tuple[float, dict[str, Vector]]] = []
        """Where things were, from which time on."""
        self.rays: list[tuple[float, dict[str, tuple[Vector, Vector]]]] = []
        """The body's log: origin and direction of eyes and forearms."""
        self.gone: list[tuple[float, str]] = []
        """Programs that have vanished, and when."""

    def take(self, message: dict[str, Any], now: float = 0.0) -> None:
        match message.get("type"):
            case "sync_point_progress":
                self.points[message["block"], message["behavior"], message["sync"]] = now
            case "block_progress" if message["progress"] == "start":
                self.ends.setdefault(message["block"], []).append("")
            case "block_progress":
                self.ends.setdefault(message["block"], [""])[-1] = message["status"]
            case "word_spoken":
                self.words.append((message["block"], message["behavior"], message["word"], now))
            case "connection_event" if message.get("block"):
                self.events[message["id"]] = message
            case "world":
                self.places.append((now, {each["id"]: each["position"] for each in message["entities"]}))
            case "robot_state":
                rays = {name: message[name] for name in ("gaze", "left_arm", "right_arm") if message.get(name)}
                self.rays.append((now, {name: (ray["origin"], ray["axis"]) for name, ray in rays.items()}))
            case "peer_gone":
                self.gone.append((now, message["participant"]))

    def decision(self, block: str, behavior: str) -> bool | None:
        """What the person did, the last time that the robot tried; None: nobody has decided."""
        told = [each for each in self.events.values() if (each["block"], each.get("behavior")) == (block, behavior)]
        if not told:
            return None
        return {"succeeded": True, "completed": True, "failed": False}.get(told[-1]["state"])

    def references(self, block: str) -> list[str]:
        """Ids of the references of a block of which anything came."""
        behaviors = {each[1] for each in (*self.points, *self.words) if each[0] == block}
        names = {name.rpartition("-")[0] for name in behaviors if name.endswith(("-gaze", "-point", "-phrase"))}
        return sorted(names - {"turn"})

    def by(self, block: str, reference: str) -> str:
        if (block, f"{reference}-point", "stroke") in self.points:
            return "pointing"
        if (block, f"{reference}-gaze", "stroke") in self.points:
            return "a look"
        return "words alone" if any(word[:2] == (block, f"{reference}-phrase") for word in self.words) else ""

    def miss(self, block: str, reference: str, thing: str, by: str) -> float:
        """Angle in degrees between a thing and what the body pointed at it, at the stroke: the least of both arms."""
        part, names = ("point", ("left_arm", "right_arm")) if by == "pointing" else ("gaze", ("gaze",))
        at = self.points[block, f"{reference}-{part}", "stroke"]
        shown = [rays for time, rays in self.rays if abs(time - at) <= SAMPLE]
        known = [places for time, places in self.places if time <= at]
        while_under_way = [places for time, places in self.places if at - SEEN <= time <= at]
        places = [each[thing] for each in (*known[-1:], *while_under_way, *known[-2:-1]) if thing in each]
        return min(
            (angle(*rays[name], place) for rays in shown for name in names if name in rays for place in places),
            default=math.inf,
        )

    def judged(self, blocks: Collection[str], written: dict[tuple[str, str], str], until: float) -> dict[str, Any]:
        """What a summary of these fragments has to say.

        written: the object of each reference, in order. until: when it was told.
        """
        made = []
        for (block, reference), thing in written.items():
            if block in blocks and (by := self.by(block, reference)):
                looked = self.decision(block, f"{reference}-event") if by != "words alone" else None
                made.append((thing, by, looked))
        contact = [
            self.decision(block, "turn-gaze-event")
            for block in blocks
            if (block, "turn-gaze", "stroke") in self.points
        ]
        said = "".join(word for block, _, word, at in self.words if block in blocks and at <= until)
        return {
            "said": letters(said), "references": made,
            "eye_contact": next((each for each in reversed(contact) if each is not None), None),
        }  # fmt: skip

    def status(self, blocks: list[str], since: float, *, is_whole: bool) -> set[str]:
        """What may be told of a turn of these fragments, from the ends of blocks and the deaths of programs.

        is_whole: its last words were said.
        """
        ends = [self.ends.get(block, []) for block in blocks]
        gone = {name for time, name in self.gone if time >= since}
        if not any(ends):
            # Nothing was done. It has failed if it waited for a body that was not there.
            return {"refused", "failed", *(["unknown"] if gone & {"generation", "realizer"} else [])}
        last = [each[-1] if each else "never begun" for each in ends]
        if "generation" in gone:
            return {"unknown", "done" if all(each == "done" for each in last) else "failed"}
        if "realizer" in gone and not all(each == "done" for each in last):
            return {"unknown", "failed", "interrupted"} if "" not in last else {"unknown"}
        for worst in ("failed", "interrupted"):
            if worst in last:
                return {worst}
        # A block may be done that a new choice has cut short, and the body gone when the rest was to be planned.
        is_done = all(each == "done" for each in last) and (is_whole or "control" not in gone)
        return {"done"} if is_done else {"failed", "interrupted"}


def angle(origin: Vector, axis: Vector, place: Vector) -> float:
    """Degrees between a ray and the direction from its origin to a place."""
    way = [there - here for there, here in zip(place, origin, strict=True)]
    cosine = sum(a * b for a, b in zip(way, axis, strict=True)) / math.hypot(*way)
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def letters(text: str) -> str:
    return "".join(each for each in text.casefold() if each.isalnum())


def told_by(result: Summary) -> dict[str, Any]:
    """The same of a summary."""
    return {
        "said": letters(result.said),
        "references": [(each.object, each.by, each.looked) for each in result.references],
        "eye_contact": result.eye_contact,
    }


async def turns(seed: int, number: int) -> list[str]:
    """Differences in so many turns of one robot."""
    chance = random.Random(seed)
    config = load(settings=["simulation.human=none"])
    differences: list[str] = []
    reader = Reader()
    async with MemoryHub() as hub, connect(hub=hub) as robot:
        lives = dict[str, AsyncExitStack]()
        await revive(lives, hub, config)
        reading = asyncio.create_task(read(hub, reader))
        for turn in range(number):
            differences += await one_turn(f"s{seed}t{turn}", chance, hub, robot, reader, lives, config)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        for life in reversed(lives.values()):
            await life.aclose()
    return differences


async def read(hub: MemoryHub, reader: Reader) -> None:
    bus = hub.join("reader")
    told = (keys.FEEDBACK, keys.SYNC_POINT, keys.ANY_CONNECTION_EVENT, keys.WORLD, keys.ROBOT_MOTION, keys.ANY_ALIVE)
    with bus.subscribe(*told) as inbox:
        async for received in inbox:
            reader.take(msgspec.to_builtins(received.message), bus.now())


async def one_turn(
    id: str,
    chance: random.Random,
    hub: MemoryHub,
    robot: Robot,
    reader: Reader,
    lives: dict[str, AsyncExitStack],
    config: Any,
) -> list[str]:
    things = [f"cup-{n}" for n in range(chance.randint(1, 3))]
    async with perceive("ann", hub=hub) as ann, AsyncExitStack() as others:
        if chance.random() < 0.3:
            await others.enter_async_context(perceive("bob", hub=hub, position=(1.2, 0.8, 1.3)))
        for thing in things:
            ann.bring(Entity(id=thing, kind="object", position=chance.choice(PLACES[:3]), category="cup"))
        if chance.random() < 0.7:
            await ann.look_at(ann.robot)
        await asyncio.sleep(0.5)
        happening = asyncio.create_task(happens(chance, ann, things, robot, lives, hub, config))
        texts = [chance.choice(("Please take", "Look at", "This is about", "")) for _ in range(2)]
        shown = chance.sample(things, min(len(things), chance.randint(1, 2)))
        is_stream = chance.random() < 0.4
        since = robot.now()
        written: dict[tuple[str, str], str] = {}
        try:
            async with asyncio.timeout(120):
                if is_stream:
                    text = " ".join(f"{text} [{thing}] now." for text, thing in zip(texts, shown, strict=False))
                    outcomes = await stream(
                        robot, pieces(text), id=id, turn=ToolInput(turn_status="full", parts=(), addressee="ann")
                    )
                    result, blocks = summary(*outcomes), [each.fragment for each in outcomes]
                    # Each sentence is a fragment, and has one reference.
                    written = {
                        (f"{id}-{number}", name): thing
                        for number, thing in enumerate(shown, start=1)
                        for name in reader.references(f"{id}-{number}")
                    }
                else:
                    parts: list[dict[str, Any]] = []
                    for text, thing in zip(texts, shown, strict=False):
                        parts += [{"say": text}] if text else []
                        parts.append({"refer": thing, "certainty": chance.choice(("normal", "high"))})
                    parts.append({"say": "for me, it is very nice."})
                    named = {f"refer-{n}": part["refer"] for n, part in enumerate(parts, start=1) if "refer" in part}
                    before = {*reader.ends}
                    call = {"turn_status": "full", "parts": parts, "addressee": "ann"}
                    result = await perform_call(robot, call)
                    blocks = [each for each in reader.ends if each not in before and "-@" in each]
                    written = {(block, name): thing for block in blocks for name, thing in named.items()}
            until = robot.now()
        finally:
            happening.cancel()
            await asyncio.gather(happening, return_exceptions=True)
        await revive(lives, hub, config)
        with suppress(EngageError):
            await robot.switch_faults(timeout=2.0)
        await asyncio.sleep(3.0)
    return compared(id, result, blocks, reader, written, since, until)


async def pieces(text: str) -> Any:
    for begin in range(0, len(text), 5):
        await asyncio.sleep(0.01)
        yield text[begin : begin + 5]


async def happens(
    chance: random.Random, ann: Any, things: list[str], robot: Robot, lives: Any, hub: Any, config: Any
) -> None:
    """What happens at random instants of one turn."""
    for _ in range(chance.randint(0, 4)):
        await asyncio.sleep(chance.uniform(0.05, 1.6))
        match chance.choice(("move", "move", "look", "face", "drop", "drop", "speak", "leave", "die")):
            case "move":
                place = chance.choice(PLACES)
                ann.bring(Entity(id=chance.choice(things), kind="object", position=place, category="cup"))
            case "look":
                await ann.look_at(chance.choice(things))
            case "face":
                await ann.look_at(ann.robot)
            case "drop":
                kind, part = (
                    chance.choice(("overheated", "stall", "slow")),
                    chance.choice(("head", "left_arm", "right_arm")),
                )
                amount = None if kind == "overheated" else chance.uniform(1.0, 3.0)
                with suppress(EngageError):
                    await robot.switch_on(BodyFault(kind=kind, part=part, amount=amount), timeout=1.0)
            case "speak" if chance.random() < 0.4:
                await ann.say("no, wait a moment please", seconds=1.5)
            case "leave" if chance.random() < 0.2:
                await ann.leave()
                break
            case "die" if chance.random() < 0.2:
                name = chance.choice(DYING)
                if (life := lives.pop(name, None)) is not None:
                    await life.aclose()
                if chance.random() < 0.5:
                    await asyncio.sleep(chance.uniform(0.1, 2.0))
                    await revive(lives, hub, config)
    # What is asked of a program that has gone waits for it (docs/bus.md), so somebody starts it again at last.
    await asyncio.sleep(STARTED_AGAIN)
    await revive(lives, hub, config)


async def revive(lives: dict[str, AsyncExitStack], hub: MemoryHub, config: Any) -> None:
    """Start again what has died."""
    for name in [name for name in SERVICES if name not in lives]:
        lives[name] = AsyncExitStack()
        await lives[name].enter_async_context(running(hub, {name: roster.service(name, config)}))


def compared(
    id: str,
    result: Summary,
    blocks: list[str],
    reader: Reader,
    written: dict[tuple[str, str], str],
    since: float,
    until: float,
) -> list[str]:
    told, found, known = told_by(result), [], [tuple(blocks)]
    is_whole = reader.judged(blocks, written, until)["said"].endswith(LAST_WORDS)
    allowed = reader.status(blocks, since, is_whole=is_whole)
    if result.status not in allowed:
        ends = [reader.ends.get(block) for block in blocks]
        found.append(f"{id}: status: told {result.status}, seen {sorted(allowed)}: {ends} {reader.gone} {result}")
    if result.status == "unknown" and any(name == "generation" and time >= since for time, name in reader.gone):
        # All is told of some fragments, and nothing of one that it died of. The next generation may perform others.
        known = [each for count in range(len(blocks) + 1) for each in combinations(blocks, count)]
    elif result.status == "unknown" and not result.said and not result.references:
        return found  # Whatever could have told is gone.
    readings = [reader.judged(each, written, until) for each in known]
    if told not in readings:
        found.append(f"{id}: told {told}, seen {readings[-1]} ({result.status}) {result.problems}")
    for (block, reference), thing in written.items():
        by = reader.by(block, reference)
        if by in ("pointing", "a look") and (miss := reader.miss(block, reference, thing, by)) > WIDEST[by]:
            found.append(f"{id}: {reference}: {by}, but {miss:.0f} degrees off {thing}")
    return found


def run(seed: int, number: int = 4) -> list[str]:
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(turns(seed, number))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--turns", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    asked = parser.parse_args()
    wrong = 0
    for seed in range(asked.first, asked.first + asked.turns // 4):
        for difference in run(seed):
            wrong += 1
            print(difference, flush=True)
    print(f"{asked.turns} turns, {wrong} differences")
    sys.exit(bool(wrong))
