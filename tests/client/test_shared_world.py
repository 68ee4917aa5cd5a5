"""A world that several participants tell: it ends up as they have it, whoever says what, and when."""

import random

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.world import Entity, World
from engage_hri.services.client.people.shared_world import GRACE, SharedWorld


def thing(id: str, x: float = 0.5) -> Entity:
    return Entity(id=id, kind="object", position=(x, 0.0, 0.7))


class Bus:
    """Passes each world on to all, in order; each link has its own delay."""

    def __init__(self, names: tuple[str, ...], chance: random.Random) -> None:
        self.worlds = {name: SharedWorld(name) for name in names}
        self.published: tuple[Entity, ...] = ()
        self.count = 0
        self._chance = chance
        self._queues: dict[str, list[tuple[str, tuple[Entity, ...]]]] = {name: [] for name in names}

    def tell(self, name: str, entities: list[Entity]) -> None:
        self._publish(name, self.worlds[name].tell(entities, 0.0))

    def _publish(self, name: str, entities: tuple[Entity, ...]) -> None:
        self.count += 1
        self.published = entities
        for queue in self._queues.values():
            queue.append((name, entities))

    def deliver(self) -> bool:
        """Deliver one message. False if there is none."""
        waiting = [name for name, queue in self._queues.items() if queue]
        if not waiting:
            return False
        name = self._chance.choice(waiting)
        source, entities = self._queues[name].pop(0)
        if self.worlds[name].take(World(entities=entities), source, 0.0):
            self._publish(name, self.worlds[name].entities)
        return True


@given(st.integers(0, 2**32 - 1))
def test_the_world_comes_to_hold_what_all_have_told(seed: int) -> None:
    chance = random.Random(seed)
    names = ("table", "ann", "bob")[: chance.randint(2, 3)]
    bus = Bus(names, chance)
    own: dict[str, dict[str, Entity]] = {name: {} for name in names}
    for _ in range(chance.randint(1, 8)):
        name = chance.choice(names)
        for number in range(chance.randint(0, 3)):
            own[name][f"{name}-{number}"] = thing(f"{name}-{number}", chance.random())
        if own[name] and chance.random() < 0.2:
            own[name].pop(chance.choice([*own[name]]))
        bus.tell(name, [*own[name].values()])
        for _ in range(chance.randint(0, 6)):
            bus.deliver()
    for _ in range(400):
        if not bus.deliver():
            break

    everything = {id: entity for entities in own.values() for id, entity in entities.items()}
    assert not bus.deliver(), "they never stop telling"
    assert {each.id: each for each in bus.published} == everything


def test_who_moves_a_thing_of_another_has_the_last_word_until_it_is_moved_again() -> None:
    table, ann = SharedWorld("table"), SharedWorld("ann")
    first = table.tell([thing("cup")], 0.0)
    ann.see(World(entities=first), "table", 0.0)
    ann.tell([thing("cup", 0.6)], 0.0)
    moved = ann.tell([thing("cup", 0.7)], 0.0)
    assert not table.see(World(entities=moved), "ann", 0.0)
    assert table.tell([thing("cup")], 0.0) == (thing("cup", 0.7),)

    left = ann.tell([], 0.0)
    assert left == (thing("cup", 0.7),)
    assert not table.see(World(entities=left), "ann", 0.0)
    assert table.tell([thing("cup", 0.1)], 0.0) == (thing("cup", 0.1),)


def test_a_late_echo_of_an_own_entity_is_no_news() -> None:
    ann = SharedWorld("ann")
    ann.tell([thing("cup", 0.6)], 0.0)
    ann.tell([thing("cup", 0.7)], 0.0)

    assert ann.see(World(entities=(thing("cup", 0.6), thing("plate"))), "table", 0.0)
    assert ann.entities == (thing("cup", 0.7), thing("plate"))


def test_what_somebody_brought_stays_for_a_grace_and_for_good_if_they_come_back() -> None:
    table = SharedWorld("table")
    table.tell([thing("cup")], 0.0)
    table.see(World(entities=(thing("cup"), thing("ann"))), "ann", 0.0)
    assert table.feed(PeerGone(participant="ann"), 10.0)  # the world that was told last has gone with it
    assert table.deadline == 10.0 + GRACE
    table.feed(PeerAlive(participant="ann"), 12.0)
    assert not table.take(None, "", 20.0)
    assert {each.id for each in table.entities} == {"cup", "ann"}

    table.feed(PeerGone(participant="ann"), 30.0)
    assert not table.take(None, "", 30.0 + GRACE - 0.1)
    assert table.take(None, "", 30.0 + GRACE)
    assert table.entities == (thing("cup"),)
