"""The simulated human at the tangram table, instead of cameras: publishes the world and what the person does."""

import random
from collections.abc import Collection, Iterable
from functools import partial

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.perception import HeadPose, Utterance, VoiceActivity
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Subscription
from engage_hri.services.client.people.perceived_person import PerceivedActions, free_seat
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.runtime.service import Ready, tell_settings
from engage_hri.services.simulation.company import AttentiveHuman, ListeningHuman
from engage_hri.services.simulation.human import Human
from engage_hri.services.simulation.party import NAMES, Party
from engage_hri.services.simulation.still import show_company, table_world
from engage_hri.services.tangram.people.appendix_b import misplacing_rules, rules
from engage_hri.services.tangram.people.cameras import Cameras
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.head import Sightlines
from engage_hri.services.tangram.people.person_at_table import PersonAtTable
from engage_hri.services.tangram.people.stochastic import Habits, StochasticHuman, requested_placement
from engage_hri.services.tangram.people.table import Table
from engage_hri.services.tangram.table import tangram_table

AWAIT_PARTICIPANTS = ("control", "generation", "realizer", "recognition")
"""Participants that must be on the bus before the person comes: the first words are lost on whoever is not there.
They may start in any order, hours apart."""


async def simulate(
    bus: Bus,
    ready: Ready,
    config: SimulationConfig,
    *,
    awaited: Collection[str] = AWAIT_PARTICIPANTS,
    habits: Habits = Habits(),  # noqa: B008
) -> None:
    """Serve until cancelled. The person comes when all that are `awaited` are on the bus.

    habits: of the `stochastic` person.
    """
    if config.human == "party":
        tell_settings(bus, "simulation", config)
        party = Party(NAMES[: config.people], random.Random(config.seed), bus.robot, bus.run)
        party.begin(bus.now())
        await show_company(bus, ready, table_with(party.people), party)
        return
    table = Table(tangram_table())
    human = _human(config, habits, bus.robot, random.Random(config.seed))
    person = PersonAtTable(human, table, robot=bus.robot, frame=config.frame, stamp=bus.stamp, life=bus.run)
    cameras = Cameras(person, Sightlines(table, bus.robot), config, bus.stamp, partial(_chance, config.seed))
    perceived, shared = PerceivedActions(bus), SharedWorld(bus.name)
    with bus.subscribe(
        keys.ANY_ROBOT_ALIVE, keys.FEEDBACK, keys.SYNC_POINT, keys.ROBOT_ACTION, keys.ANY_CONNECTION_EVENT,
        keys.ROBOT_SEEN, keys.BODY_FAULTS, keys.WORLD,
        *([keys.ROBOT_MOTION] if config.perception == "raw" else []),
    ) as inbox:  # fmt: skip
        bus.publish(keys.WORLD, _whole(cameras.world(bus.now()), shared, bus.now()))
        tell_settings(bus, "simulation", config)
        ready()
        await _wait_for(set(awaited), inbox)
        if config.human != "none":
            cameras.enter(bus.now() + config.entrance)
        while not inbox.is_over:
            due = [at for at in (cameras.deadline, shared.deadline) if at is not None]
            received = await inbox.next(min(due, default=None))
            now = bus.now()
            message, source = (received.message, received.source) if received else (None, "")
            if shared.take(message, source, now):
                bus.publish(keys.WORLD, World(entities=shared.entities, at=bus.stamp()))
            if received is not None:
                cameras.feed(received.message, now)
            reports = list(cameras.advance(now))
            for message in reports:
                bus.publish(_key(message), _whole(message, shared, now) if isinstance(message, World) else message)
            perceived.follow(reports)


def table_with(people: Iterable[str]) -> World:
    """The table with these people around it."""
    entities = [each for each in table_world().entities if each.kind in ("object", "surface")]
    seats: list[Vector] = []
    for person in people:
        seats.append(free_seat(seats))
        entities.append(Entity(id=person, kind="person", position=seats[-1]))
    return World(entities=tuple(entities))


def _whole(world: World, shared: SharedWorld, now: Seconds) -> World:
    """The world with what others have told of besides."""
    return World(entities=shared.tell(world.entities, now), at=world.at)


def _key(message: Message) -> str:
    match message:
        case World():
            return keys.WORLD
        case HeadPose(actor=actor):
            return keys.head_pose(actor)
        case VoiceActivity(actor=actor):
            return keys.voice_activity(actor)
        case Utterance():
            return keys.UTTERANCE
        case _:
            return keys.PERCEIVED_ACTION


def _chance(seed: int, name: str) -> random.Random:
    """A source of chance of its own for each fault."""
    return random.Random(f"{seed} {name}")


def _human(config: SimulationConfig, habits: Habits, robot: str, chance: random.Random) -> Human:
    def vary() -> Seconds:
        return chance.uniform(-config.jitter, config.jitter)

    table = tangram_table()
    asked = partial(requested_placement, table=table)
    match config.human:
        case "appendix-b":
            return Human(rules(), robot, vary)
        case "misplacing":
            return Human(misplacing_rules(), robot, vary)
        case "listening":
            return ListeningHuman(asked, robot, vary)
        case "stochastic":
            return StochasticHuman(table, habits, config.reciprocity, chance, robot)
        case "attentive":
            pieces = frozenset(piece.id for piece in table.pieces)
            return AttentiveHuman(table.person.id, pieces, robot, vary, asked)
        case "none" | "party":
            return Human((), robot, vary)


async def _wait_for(participants: set[str], inbox: Subscription) -> None:
    while participants:
        received = await inbox.next()
        if received is None:
            return
        if isinstance(received.message, PeerAlive):
            participants.discard(received.message.participant)
