"""Words and actions of people, for a manager: as they are recognized; words in the outcomes of what it performs."""

from collections.abc import Iterable
from typing import TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.schemas.fragments import FragmentOutcome, HeardText
from engage_hri.schemas.perception import Utterance
from engage_hri.services.client.feeds import ActionFeed, Feed
from engage_hri.services.client.studied import Studied
from engage_hri.services.requests.ends import Requester

MOST = 256
"""Number of utterances that are remembered."""
O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


class NewWords:
    """Words that one reader of outcomes has not been told yet: each outcome repeats those since the turn before."""

    def __init__(self) -> None:
        self._told: dict[tuple[str, str], str] = {}
        """Text of each utterance, by person and id."""

    def of(self, heard: Iterable[HeardText]) -> tuple[HeardText, ...]:
        """Return those that are new, or say something else than before; from now on they are known."""
        new = tuple(each for each in heard if self._told.get((each.actor, each.id)) != each.text)
        for each in new:
            self._told.pop((each.actor, each.id), None)
            self._told[each.actor, each.id] = each.text
        while len(self._told) > MOST:
            del self._told[next(iter(self._told))]
        return new


class Hearing(Studied):
    """The part of `Robot` that tells what people say, and what they and the robot do."""

    _words: NewWords
    _requests: Requester

    def actions(self) -> Feed[ActionBegan | ActionEnded | ActorFound | ActorLost]:
        """Follow the actions of the robot and of people as they are seen, and the coming and going of people.

        It begins with the people who are there and with what goes on now. What a program told that was killed is over
        after 4 s: its people go, and their actions end.
        """
        self._requests.check()
        return ActionFeed(self._bus)

    def utterances(self) -> Feed[Utterance]:
        """Follow the words of people: partial results, final ones, corrections, as perception tells them."""
        return self._feed((Utterance,), keys.UTTERANCE)

    def _with_new_words(self, outcome: O) -> O:
        """Leave out of an outcome what this client has been told by an earlier one."""
        if isinstance(outcome, FragmentOutcome) and outcome.heard:
            return replace(outcome, heard=self._words.of(outcome.heard))
        return outcome
