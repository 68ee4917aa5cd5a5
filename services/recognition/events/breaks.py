"""Ends of looks that are none: the tracker has lost the eyes for a moment, and finds them where they were.

Where perception reports looks itself, an end that goes with a loss of the face, or that the same look follows within
a short pause, is left out. Until the pause is over it is undecided whether there was an end.
"""

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.limits import in_time

Told = ActionBegan | ActionEnded | ActorFound | ActorLost
Passed = tuple[Seconds, Told]


class _Break(Struct):
    """since: when the look ended, or when the face that was lost then was found again."""

    ended: ActionEnded
    since: Seconds
    lost: bool


class Breaks:
    """Of all people. pause: how soon the same look has to follow."""

    def __init__(self, pause: Seconds) -> None:
        self._pause = pause
        self._breaks: dict[str, _Break] = {}
        self._lost: set[str] = set()
        """Whose face is out of sight."""

    @property
    def undecided(self) -> list[Seconds]:
        """Since when looks may be over. While the face is lost they are taken to go on."""
        return [one.since for one in self._breaks.values() if not one.lost]

    @property
    def deadline(self) -> Seconds | None:
        """When one of them is over, unless it goes on before."""
        return min((since + self._pause for since in self.undecided), default=None)

    def feed(self, told: Told, at: Seconds) -> list[Passed]:
        """What perception says; what of it holds, with its times."""
        match told:
            case ActionEnded(action="look", actor=actor):
                before = self._end(actor)
                self._breaks[actor] = _Break(told, at, actor in self._lost)
                return before
            case ActionBegan(action="look", actor=actor):
                return [*self._begin(told, at), (at, told)]
            case ActionBegan(actor=actor) | ActorFound(actor=actor):
                self._find(actor, at)
            case ActorLost(actor=actor):
                self._lost.add(actor)
                if actor in self._breaks:
                    self._breaks[actor].lost = True
        return [(at, told)]

    def advance(self, now: Seconds) -> list[Passed]:
        """The ends that have turned out to be some."""
        over = [actor for actor, one in self._breaks.items() if not one.lost and now >= one.since + self._pause]
        return [passed for actor in over for passed in self._end(actor)]

    def forget(self, actor: str) -> None:
        self._breaks.pop(actor, None)
        self._lost.discard(actor)

    def _begin(self, began: ActionBegan, at: Seconds) -> list[Passed]:
        """A look: the one that was interrupted, or another one, that ends it."""
        self._find(began.actor, at)
        one = self._breaks.get(began.actor)
        goes_on = one is not None and one.ended.targets == began.targets
        if one is not None and goes_on and one.since <= at and in_time(at, one.since + self._pause):
            del self._breaks[began.actor]
        return self._end(began.actor)

    def _find(self, actor: str, at: Seconds) -> None:
        self._lost.discard(actor)
        one = self._breaks.get(actor)
        if one is not None and one.lost:
            one.since, one.lost = max(at, one.since), False

    def _end(self, actor: str) -> list[Passed]:
        one = self._breaks.pop(actor, None)
        return [] if one is None else [(one.since, one.ended)]
