"""An independent reader of what a robot did: from feedback, the voice's words and told events alone.

It takes nothing of generation, and nothing that computes summaries: `by`, `looked`, `eye_contact`, `said` and status
are decided once more from messages that the realizer, the body and recognition have sent, for turns in worlds
that change at random. `python -m tests.generation.deeds --turns 10000` tries many, and prints each difference.
"""

import argparse
import asyncio
import random
import sys
from contextlib import AsyncExitStack, suppress
from typing import Any

import msgspec

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.summary import Referred, Summary, summary
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline import roster
from engage_hri.services.commandline.config import load
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

PLACES = ((0.5, 0.2, 0.8), (0.45, -0.2, 0.8), (0.6, 0.0, 0.8), (-1.0, 0.2, 0.8), (0.05, 0.0, 1.15), (3.0, 1.0, 0.5))
"""Places of objects: three within reach, one behind the robot, one above its shoulder, one far away."""
SERVICES = (*roster.ROBOT, "simulation")
DYING = ("generation", "realizer", "control", "recognition")


class Reader:
    """What was seen on the bus, as plain values."""

    def __init__(self) -> None:
        self.points: set[tuple[str, str, str]] = set()
        self.ends: dict[str, str] = {}
        """The last end of each block; empty: it goes on."""
        self.words: list[tuple[str, str, str]] = []
        self.events: dict[str, dict[str, Any]] = {}
        self.silent: set[str] = set()
        """Blocks of which something was dropped."""

    def take(self, message: dict[str, Any]) -> None:
        match message.get("type"):
            case "sync_point_progress":
                self.points.add((message["block"], message["behavior"], message["sync"]))
            case "block_progress" if message["progress"] == "start":
                self.ends[message["block"]] = ""
            case "block_progress":
                self.ends[message["block"]] = message["status"]
            case "word_spoken":
                self.words.append((message["block"], message["behavior"], message["word"]))
            case "connection_event" if message.get("block"):
                self.events[message["id"]] = message

    def decision(self, block: str, behavior: str) -> bool | None:
        told = [each for each in self.events.values() if (each["block"], each.get("behavior")) == (block, behavior)]
        states = {each["state"] for each in told}
        if states & {"succeeded", "completed"}:
            return True
        return False if "failed" in states else None

    def by(self, block: str, reference: str) -> str:
        if (block, f"{reference}-point", "stroke") in self.points:
            return "pointing"
        if (block, f"{reference}-gaze", "stroke") in self.points:
            return "a look"
        return "words alone" if any(word[:2] == (block, f"{reference}-phrase") for word in self.words) else ""

    def judged(self, blocks: list[str], references: list[tuple[str, str, str]]) -> dict[str, Any]:
        """What a summary of these fragments has to say. references: fragment, id of the behavior, object."""
        made = []
        for block, reference, thing in references:
            if by := self.by(block, reference):
                looked = self.decision(block, f"{reference}-event") if by != "words alone" else None
                made.append((thing, by, looked))
        contact = [
            self.decision(block, "turn-gaze-event")
            for block in blocks
            if (block, "turn-gaze", "stroke") in self.points
        ]
        said = "".join(word for block, _, word in self.words if block in blocks)
        return {
            "said": letters(said), "references": made,
            "eye_contact": next((each for each in reversed(contact) if each is not None), None),
        }  # fmt: skip


__all__ = ["Reader", "Referred", "compared", "run", "summary"]


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
    with bus.subscribe(keys.FEEDBACK, keys.SYNC_POINT, keys.ANY_CONNECTION_EVENT) as inbox:
        async for received in inbox:
            reader.take(msgspec.to_builtins(received.message))


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
        try:
            async with asyncio.timeout(120):
                if is_stream:
                    written = " ".join(f"{text} [{thing}] now." for text, thing in zip(texts, shown, strict=False))
                    outcomes = await stream(robot, pieces(written), id=id)
                    result, blocks = summary(*outcomes), [each.fragment for each in outcomes]
                else:
                    parts: list[dict[str, Any]] = []
                    for text, thing in zip(texts, shown, strict=False):
                        parts += [{"say": text}] if text else []
                        parts.append({"refer": thing, "certainty": chance.choice(("normal", "high"))})
                    parts.append({"say": "for me, it is very nice."})
                    before = {*reader.ends}
                    call = {"turn_status": "full", "parts": parts, "addressee": "ann"}
                    result = await perform_call(robot, call)
                    blocks = [each for each in reader.ends if each not in before and "-@" in each]
        finally:
            happening.cancel()
            await asyncio.gather(happening, return_exceptions=True)
        await revive(lives, hub, config)
        with suppress(EngageError):
            await robot.switch_faults(timeout=2.0)
        await asyncio.sleep(3.0)
    return compared(id, result, blocks, reader)


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
                return
            case "die" if chance.random() < 0.2:
                name = chance.choice(DYING)
                if (life := lives.pop(name, None)) is not None:
                    await life.aclose()
                if chance.random() < 0.5:
                    await asyncio.sleep(chance.uniform(0.1, 2.0))
                    await revive(lives, hub, config)


async def revive(lives: dict[str, AsyncExitStack], hub: MemoryHub, config: Any) -> None:
    """Start again what has died."""
    for name in [name for name in SERVICES if name not in lives]:
        lives[name] = AsyncExitStack()
        await lives[name].enter_async_context(running(hub, {name: roster.service(name, config)}))


def compared(id: str, result: Summary, blocks: list[str], reader: Reader) -> list[str]:
    told = told_by(result)
    references = [
        (block, behavior.removesuffix(end), "")
        for block in blocks
        for behavior in sorted({each[1] for each in reader.points if each[0] == block})
        for end in ("-gaze", "-point", "-phrase")
        if behavior.endswith(end) and not behavior.startswith("turn-")
    ]
    judged = reader.judged(blocks, list(dict.fromkeys(references)))
    if result.status == "unknown" and not result.said and not result.references:
        return []  # whoever could have told is gone
    found = []
    for name in ("said", "eye_contact"):
        if told[name] != judged[name]:
            found.append(f"{id}: {name}: told {told[name]!r}, seen {judged[name]!r} ({result.status})")
    ours, seen = (
        sorted(map(str, (each[1:] for each in told["references"]))),
        sorted(map(str, (each[1:] for each in judged["references"]))),
    )
    if ours != seen:
        found.append(f"{id}: references: told {ours}, seen {seen} ({result.status}) {result.problems}")
    ends = [reader.ends.get(block) for block in blocks]
    if result.status == "done" and any(end != "done" for end in ends):
        found.append(f"{id}: status: done, but blocks ended {ends}")
    if result.status == "refused" and any(end is not None for end in ends):
        found.append(f"{id}: status: refused, but blocks began")
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
