"""Actions and words of one person, as the events and messages by which a perception tells of them. Pure."""

from collections.abc import Iterator
from itertools import count

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.reports.ongoing_actions import ActionEvent


class PersonActions:
    """The actions of one person. A new look ends the last; who leaves does nothing any more.

    person: actor id. is_here: perception sees the person. look: ids that it looks at; None: no look goes on.
    """

    def __init__(self, person: str) -> None:
        self.person = person
        self.is_here = False
        self.look: tuple[str, ...] | None = None
        self._others: dict[tuple[Action, tuple[str, ...]], None] = {}
        """Actions that go on besides the look."""

    def comes(self, at: Stamp) -> Iterator[ActionEvent]:
        """Let the person come. What it does already is told again: perception sees it now."""
        if self.is_here:
            return
        self.is_here = True
        yield ActorFound(actor=self.person, at=at)
        if self.look is not None:
            yield ActionBegan(actor=self.person, action="look", targets=self.look, at=at)
        for action, targets in self._others:
            yield ActionBegan(actor=self.person, action=action, targets=targets, at=at)

    def leaves(self, at: Stamp) -> Iterator[ActionEvent]:
        """Let the person leave, and end what it does."""
        for action, targets in tuple(self._others):
            yield from self.ends(action, targets, at)
        if self.is_here and self.look is not None:
            yield ActionEnded(actor=self.person, action="look", targets=self.look, at=at)
        self.look = None
        if self.is_here:
            self.is_here = False
            yield ActorLost(actor=self.person, at=at, left=True)

    def looks(self, targets: tuple[str, ...], at: Stamp) -> Iterator[ActionEvent]:
        """Look at these; empty: away from everything. A look at what is looked at already changes nothing."""
        if targets == self.look:
            return
        if self.is_here and self.look is not None:
            yield ActionEnded(actor=self.person, action="look", targets=self.look, at=at)
        self.look = targets
        if self.is_here:
            yield ActionBegan(actor=self.person, action="look", targets=targets, at=at)

    def begins(self, action: Action, targets: tuple[str, ...], at: Stamp) -> Iterator[ActionEvent]:
        """Begin an action. One of its kind, with the same targets, that goes on is ended first."""
        if action == "look":
            yield from self.looks(targets, at)
            return
        yield from self.ends(action, targets, at)
        self._others[action, targets] = None
        if self.is_here:
            yield ActionBegan(actor=self.person, action=action, targets=targets, at=at)

    def ends(self, action: Action, targets: tuple[str, ...], at: Stamp) -> Iterator[ActionEvent]:
        """End an action with the targets of its beginning; nothing, if it does not go on."""
        if action == "look":
            if self.is_here and self.look is not None and targets in ((), self.look):
                yield ActionEnded(actor=self.person, action="look", targets=self.look, at=at)
            self.look = None
        elif (action, targets) in self._others:
            del self._others[action, targets]
            if self.is_here:
                yield ActionEnded(actor=self.person, action=action, targets=targets, at=at)


WORD: Seconds = 0.35
"""Time for which a word is spoken, by and large."""
RECOGNIZING: Seconds = 0.3
"""Time from the end of speech until a recognizer knows its words for good."""


class Utterances:
    """The utterances of one person.

    person: actor id. life: of the one who tells of them, so that no id comes again after a restart.
    """

    def __init__(self, person: str, life: str) -> None:
        self._person = person
        self._life = life
        self._numbers = count(1)

    def typed(self, text: str, at: Stamp, to: tuple[str, ...] = ()) -> Utterance:
        """Make the message of a line that is sent at once."""
        return Utterance(actor=self._person, id=self._id(), text=text, began=at, at=at, to=to)

    def begun(self, began: Stamp, to: tuple[str, ...] = ()) -> Utterance:
        """Make the first message of an utterance: somebody speaks, and the words will come."""
        return Utterance(actor=self._person, id=self._id(), text="", began=began, at=began, final=False, to=to)

    def _id(self) -> str:
        return f"{self._life}-{next(self._numbers)}"


def partial_texts(text: str) -> Iterator[str]:
    """Tell what is known after each word: `put`, `put it`, `put it there`."""
    words = text.split()
    return (" ".join(words[:number]) for number in range(1, len(words) + 1))


def speaking_time(text: str) -> Seconds:
    """Estimate how long the words take: `WORD` each, and at least one."""
    return WORD * max(1, len(text.split()))
