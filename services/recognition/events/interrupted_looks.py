"""Filter for reported looks that are only interrupted, because the tracker loses the eyes for a moment.

Where perception reports looks itself, the end of a look is left out if it goes with a loss of the face, or if the
same look follows within a short pause. Until the pause is over the end is undecided.
"""

from msgspec import Struct

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.limits import in_time

LOOK_BREAK: Seconds = 0.15
"""Longest pause in a look: one that is reported to end and to begin again within it has gone on. What happens
meanwhile waits for the decision, for `SETTLING` at most, so it must not be longer. Ours."""
Symbolic = ActionBegan | ActionEnded | ActorFound | ActorLost
Timed = tuple[Seconds, Symbolic]


class _Break(Struct):
    """Possible end of a look. since: time of that end, or at which the face that was lost then was found again."""

    ended: ActionEnded
    since: Seconds
    lost: bool


class InterruptedLooks:
    """The filter for all people."""

    def __init__(self) -> None:
        self._breaks: dict[str, _Break] = {}
        self._lost: set[str] = set()
        """People with their face out of sight."""

    @property
    def undecided(self) -> list[Seconds]:
        """Times since which looks may be over. While the face is lost a look is taken to go on."""
        return [one.since for one in self._breaks.values() if not one.lost]

    @property
    def deadline(self) -> Seconds | None:
        """Time at which the earliest undecided end becomes certain, unless the look goes on before."""
        return min((since + LOOK_BREAK for since in self.undecided), default=None)

    def feed(self, report: Symbolic, at: Seconds) -> list[Timed]:
        """Take a report of perception. Returns the reports that hold now, each with its time."""
        match report:
            case ActionEnded(action="look", actor=actor, targets=targets):
                if actor in self._breaks and self._breaks[actor].ended.targets == targets:
                    return []  # it comes twice, and makes nothing certain
                before = self._end(actor)
                self._breaks[actor] = _Break(report, at, actor in self._lost)
                return before
            case ActionBegan(action="look", actor=actor):
                return [*self._begin(report, at), (at, report)]
            case ActionBegan(actor=actor) | ActorFound(actor=actor):
                self._find(actor, at)
            case ActorLost(actor=actor):
                self._lost.add(actor)
                if actor in self._breaks:
                    self._breaks[actor].lost = True
        return [(at, report)]

    def advance(self, now: Seconds) -> list[Timed]:
        """Return the ends of looks that have become certain by `now`."""
        over = [actor for actor, one in self._breaks.items() if not one.lost and now >= one.since + LOOK_BREAK]
        return [ended for actor in over for ended in self._end(actor)]

    def forget(self, actor: str) -> None:
        self._breaks.pop(actor, None)
        self._lost.discard(actor)

    def _begin(self, began: ActionBegan, at: Seconds) -> list[Timed]:
        """Take the beginning of a look: it goes on with the interrupted one, or makes the end of that certain."""
        self._find(began.actor, at)
        one = self._breaks.get(began.actor)
        goes_on = one is not None and one.ended.targets == began.targets
        if one is not None and goes_on and one.since <= at and in_time(at, one.since + LOOK_BREAK):
            del self._breaks[began.actor]
        return self._end(began.actor)

    def _find(self, actor: str, at: Seconds) -> None:
        self._lost.discard(actor)
        one = self._breaks.get(actor)
        if one is not None and one.lost:
            one.since, one.lost = max(at, one.since), False

    def _end(self, actor: str) -> list[Timed]:
        one = self._breaks.pop(actor, None)
        return [] if one is None else [(one.since, one.ended)]
