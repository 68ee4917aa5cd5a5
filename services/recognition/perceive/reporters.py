"""Participants that report what people do: when one vanishes from the bus, its people are lost with it."""

from msgspec.structs import replace

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Stamp

_Going = dict[tuple[str, tuple[str, ...]], ActionBegan]
"""What a person does, by action and targets; a look has no targets here, for a new one ends the last."""


class Reporters:
    """The people that each participant reports, and what they do.

    They are lost with it. If its life comes back they are found, and go on with what they did: it says once that an
    action has begun, and what has ended meanwhile it says after that.
    """

    def __init__(self) -> None:
        self._reported: dict[str, dict[str, _Going]] = {}
        self._runs: dict[str, str] = {}

    def feed(self, message: Message, source: str, at: Stamp) -> list[ActorLost | ActorFound | ActionBegan]:
        """Derive what a message from a reporter, or about its presence, says of its people. at: now."""
        match message:
            case ActionBegan(actor=actor):
                self._reported.setdefault(source, {}).setdefault(actor, {})[_which(message)] = message
            case ActionEnded(actor=actor):
                self._end(message, self._reported.get(source, {}).get(actor, {}))
            case ActorFound(actor=actor):
                self._reported.setdefault(source, {}).setdefault(actor, {})
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
                people = sorted(self._reported.get(name, {}).items())
                going = [replace(begun, at=at) for _, actions in people for begun in actions.values()]
                return [*(ActorFound(actor=actor, at=at) for actor, _ in people), *going]
        return []

    def _end(self, ended: ActionEnded, going: _Going) -> None:
        begun = going.get(_which(ended))
        if begun is not None and begun.targets == ended.targets:
            del going[_which(ended)]

    def forget(self, actor: str) -> None:
        """Drop a person who has been gone for long from all reporters."""
        for source in list(self._reported):
            self._discard(actor, source)

    def _discard(self, actor: str, source: str) -> None:
        reported = self._reported.get(source, {})
        reported.pop(actor, None)
        if not reported:
            self._reported.pop(source, None)


def _which(message: ActionBegan | ActionEnded) -> tuple[str, tuple[str, ...]]:
    return message.action, () if message.action == "look" else message.targets
