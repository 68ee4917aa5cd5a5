"""Participants that report what people do: when one vanishes from the bus, its people are lost with it."""

from engage_hri.schemas.actions import ActionBegan, ActorFound, ActorLost
from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Stamp


class Reporters:
    """The people that each participant reports. They are lost with it, and found again if its life comes back."""

    def __init__(self) -> None:
        self._reported: dict[str, set[str]] = {}
        self._runs: dict[str, str] = {}

    def feed(self, message: Message, source: str, at: Stamp) -> list[ActorLost | ActorFound]:
        """Derive what a message from a reporter, or about its presence, says of its people. at: now."""
        match message:
            case ActionBegan(actor=actor) | ActorFound(actor=actor):
                self._reported.setdefault(source, set()).add(actor)
            case ActorLost(actor=actor):
                self._discard(actor, source)
            case PeerGone(participant=name):
                if name not in self._reported:
                    self._runs.pop(name, None)
                return [ActorLost(actor=actor, at=at) for actor in sorted(self._reported.get(name, ()))]
            case PeerAlive(participant=name, run=run):
                before = self._runs.get(name, run)
                self._runs[name] = run
                if before != run:
                    self._reported.pop(name, None)
                return [ActorFound(actor=actor, at=at) for actor in sorted(self._reported.get(name, ()))]
        return []

    def forget(self, actor: str) -> None:
        """Drop a person who has been gone for long from all reporters."""
        for source in list(self._reported):
            self._discard(actor, source)

    def _discard(self, actor: str, source: str) -> None:
        reported = self._reported.get(source, set())
        reported.discard(actor)
        if not reported:
            self._reported.pop(source, None)
