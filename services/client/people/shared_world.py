"""The world of several participants: each publishes the whole of it, its own part and what the others told. Pure.

`World` is one snapshot, and who publishes one replaces what was there. So each repeats what others know. An entity is
of the participant that brought it or changed it last; who sees its own entity missing, or older than it was told,
publishes again. What a participant brought stays for a grace after it has vanished, for mostly only its link is cut.
"""

from collections import deque
from collections.abc import Iterable

from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World

GRACE: Seconds = 4.0
"""Time for which what a participant brought stays after it has gone; what it said of people holds as long."""
ECHO: Seconds = 1.0
"""Time for which others may still repeat what its owner has taken away."""
REMEMBERED = 64
"""States of one entity of our own that are remembered, to know them when others repeat them late."""


class SharedWorld:
    """The world as one participant publishes it. name: the participant's.

    entities: the whole of it. deadline: when to call `advance`.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._entities: dict[str, Entity] = {}
        self._owner: dict[str, str] = {}
        """Participant of which each entity is."""
        self._before: dict[str, str] = {}
        """Participant of which an entity was before we changed it: it gets it back."""
        self._given: dict[str, Entity] = {}
        """What was last given to `tell`, by id."""
        self._told: dict[str, deque[Entity]] = {}
        """Our own entities as they were told, the newest last."""
        self._had: dict[str, frozenset[str]] = {}
        """Ids in the last world of each other participant: what it had and has no more, somebody has taken away."""
        self._taken_away: dict[str, tuple[str, Seconds]] = {}
        """Entities that are not there any more: by whom they were taken away, and when."""
        self._gone: dict[str, Seconds] = {}
        """Participants that have gone, and since when."""
        self._last = ""
        """Participant whose world was published last."""

    @property
    def entities(self) -> tuple[Entity, ...]:
        return tuple(self._entities.values())

    @property
    def others(self) -> tuple[Entity, ...]:
        """The entities that others brought or changed last."""
        return tuple(entity for id, entity in self._entities.items() if self._owner[id] != self._name)

    def tell(self, entities: Iterable[Entity], now: Seconds) -> tuple[Entity, ...]:
        """Take all of our own part as it is now. Returns the whole, to be published.

        What another has changed since stays as the other has it, until we change it, too.
        """
        given = {entity.id: entity for entity in entities}
        for id, entity in given.items():
            if entity != self._given.get(id) or id not in self._entities:
                if (owner := self._owner.get(id, self._name)) != self._name and id not in self._given:
                    self._before[id] = owner
                self._entities[id], self._owner[id] = entity, self._name
                self._told.setdefault(id, deque(maxlen=REMEMBERED)).append(entity)
        for id in self._given.keys() - given.keys():
            if (owner := self._before.pop(id, "")) and self._owner.get(id) == self._name:
                self._owner[id] = owner
            elif self._owner.get(id) == self._name:
                self._drop(id, now)
        self._given = given
        self._last = self._name
        return self.entities

    def take(self, message: Message | None, source: str, now: Seconds) -> bool:
        """Take a message of `source` about the world, or about who is there, or that there is none by `now`.

        True if the world has to be told again.
        """
        again = self.advance(now)
        match message:
            case None:
                return again
            case World():
                return self.see(message, source, now) or again
        return self.feed(message, now) or again

    def see(self, world: World, source: str, now: Seconds) -> bool:
        """Take a world that another has published. True if it lacks something of ours, and has to be told again."""
        if source == self._name:
            return False
        self._last = source
        seen = {entity.id: entity for entity in world.entities}
        lacks, had = False, self._had.get(source, frozenset())
        self._had[source] = frozenset(seen)
        for id, entity in tuple(self._entities.items()):
            theirs = seen.get(id)
            if self._owner[id] == self._name:
                lacks |= theirs is None or (theirs != entity and theirs in self._told.get(id, ()))
            elif theirs is None and (self._owner[id] == source or id in had):
                lacks |= self._let_go(id, now)
        self._taken_away = {id: taken for id, taken in self._taken_away.items() if now <= taken[1] + ECHO}
        for id, entity in seen.items():
            known = self._entities.get(id)
            if known is None and self._taken_away.get(id, (source,))[0] != source:
                lacks |= self._taken_away[id][0] == self._name
                continue
            is_echo = known is not None and (
                entity == known or (self._owner[id] == self._name and entity in self._told.get(id, ()))
            )
            if not is_echo:
                self._entities[id], self._owner[id] = entity, source
        return lacks

    def feed(self, message: Message, now: Seconds) -> bool:
        """Take news of who comes and goes. True if the world has to be told again: who told it last has gone."""
        match message:
            case PeerGone(participant=name) if name in self._owner.values() or name == self._last:
                self._gone[name] = now
                return name == self._last
            case PeerAlive(participant=name):
                self._gone.pop(name, None)
        return False

    @property
    def deadline(self) -> Seconds | None:
        return min((since + GRACE for since in self._gone.values()), default=None)

    def advance(self, now: Seconds) -> bool:
        """Drop what those brought who have been gone for longer than the grace. True if that was something."""
        dropped = False
        for name in [name for name, since in self._gone.items() if now >= since + GRACE]:
            del self._gone[name]
            self._had.pop(name, None)
            for id in [id for id, owner in self._owner.items() if owner == name]:
                self._let_go(id, now)
                dropped = True
        return dropped

    def _let_go(self, id: str, now: Seconds) -> bool:
        """Take what another has left: ours stays where they left it, and theirs is gone. True if it is ours."""
        if id not in self._given:
            self._drop(id, now)
            return False
        self._owner[id] = self._name
        self._told.setdefault(id, deque(maxlen=REMEMBERED)).append(self._entities[id])
        return True

    def _drop(self, id: str, now: Seconds) -> None:
        self._taken_away[id] = (self._owner.pop(id), now)
        del self._entities[id]
