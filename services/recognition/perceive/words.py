"""Words of people: which speech they belong to, and words without any, which are speech by themselves. Pure.

Only final words count. Those of an utterance belong to the speech of that person with which they overlap longest; of
two with the same overlap to the later one. Recognizers and voice detectors disagree about beginnings and ends, so
words may miss the speech by a margin. A line, words that take no time, has been typed: there is no margin for it.

What the robot itself says, heard back, are no words of anybody (`own_words`).
"""

from math import inf

from msgspec import Struct

from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.limits import ROUNDING
from engage_hri.services.recognition.events.scene import Worded
from engage_hri.services.text.own_words import OwnWords

WORDS_MARGIN: Seconds = 0.5
"""Time by which spoken words may miss the speech that they belong to: recognizers and voice detectors disagree about
where speech begins and ends. Decision 0065."""
SPEECHES_KEPT = 64
"""Number of speeches of each person, and of utterances, that are remembered."""


class TimedWords(Struct, frozen=True, kw_only=True):
    """Observation: an `Utterance`, with its times on the local clock. ended: as it was said, or when it was known."""

    actor: str
    id: str
    text: str
    began: Seconds
    ended: Seconds
    final: bool = True
    confidence: Probability = 1.0
    to: frozenset[str] | None = None
    """Addressees, if perception knows them."""

    @property
    def is_line(self) -> bool:
        """True if it takes no time: a line that was typed."""
        return self.ended <= self.began


class _Speech(Struct):
    """A speech as it was told. until: inf: it goes on."""

    since: Seconds
    until: Seconds = inf


class _Known(Struct):
    """An utterance that is known. at: when this much of it was. speech: start of the speech that it belongs to."""

    at: Seconds
    began: Seconds
    text: str
    speech: Seconds


class _Person:
    """Speech and words of one person."""

    def __init__(self) -> None:
        self.speeches: list[_Speech] = []
        self.utterances: Latest[str, _Known] = Latest(SPEECHES_KEPT)

    def begins(self, at: Seconds) -> None:
        last = self.speeches[-1] if self.speeches else None
        if last is not None and (at <= last.since or (last.until < inf and at < last.until)):
            return  # repeated, or overtaken
        if last is not None:
            last.until = min(last.until, at)  # its end has been lost
        self.speeches = [*self.speeches[1 - SPEECHES_KEPT :], _Speech(at)]

    def ends(self, at: Seconds) -> None:
        if self.speeches and at >= self.speeches[-1].since:
            self.speeches[-1].until = min(self.speeches[-1].until, at)

    def said_alone(self, began: Seconds, ended: Seconds) -> None:
        """Note a speech that nothing but words tells of."""
        self.speeches = sorted([*self.speeches[1 - SPEECHES_KEPT :], _Speech(began, ended)], key=_since)

    def speech_with(self, words: TimedWords) -> Seconds | None:
        """Start of the speech that these words belong to; None if there is none."""
        least = -ROUNDING if words.is_line else -WORDS_MARGIN - ROUNDING
        found: tuple[Seconds, Seconds] | None = None
        for speech in self.speeches:
            overlap = min(words.ended, speech.until) - max(words.began, speech.since)
            if overlap >= least and (found is None or overlap >= found[0] - ROUNDING):
                found = (overlap, speech.since)
        return None if found is None else found[1]

    def text_of(self, speech: Seconds) -> str:
        """All words of a speech, in the order in which they were said."""
        said = sorted((one.began, id, one.text) for id, one in self.utterances.items() if one.speech == speech)
        return " ".join(text for _, _, text in said if text)


class Words:
    """The words of all people. clock: of the stamps of speech that is derived from them."""

    def __init__(self, clock: str) -> None:
        self._clock = clock
        self._people: dict[str, _Person] = {}
        self.own = OwnWords()
        """Words of the robot."""

    def follow(self, action: ActionBegan | ActionEnded, at: Seconds) -> None:
        """Take the beginning or the end of a person's speech; other actions say nothing of words."""
        if action.action != "speak":
            return
        if isinstance(action, ActionBegan):
            self._people.setdefault(action.actor, _Person()).begins(at)
        elif (person := self._people.get(action.actor)) is not None:
            person.ends(at)

    def hear(self, words: TimedWords, at: Seconds) -> Worded | None:
        """Take words that are known at `at`. Returns what a speech consists of now; None if they say nothing new."""
        person = self._people.get(words.actor) or _Person()
        known = person.utterances.get(words.id)
        is_echo = not words.is_line and self.own.are(words.text, words.began, is_final=words.final)
        text = "" if is_echo else " ".join(words.text.split())
        if not words.final:
            return self._told_early(person, words, is_echo=is_echo)
        if known is not None and at <= known.at:
            return None
        speech = person.speech_with(words) if known is None else known.speech
        is_alone = speech is None
        if speech is None:
            if is_echo:
                return Worded(actor=words.actor, since=words.began, text="", is_announced=True)
            if not text:
                return None
            speech = words.began
            person.said_alone(words.began, max(words.began, words.ended))
        self._people[words.actor] = person  # not before: of who has said nothing there is nothing to remember
        person.utterances[words.id] = _Known(at, words.began, text, speech)
        return Worded(
            actor=words.actor, since=speech, text=person.text_of(speech), is_alone=is_alone,
            is_line=is_alone and words.is_line, to=words.to, is_announced=is_echo, is_echo=is_echo,
        )  # fmt: skip

    def _told_early(self, person: _Person, words: TimedWords, *, is_echo: bool) -> Worded | None:
        """News that words will come, and addressees that perception knows before it is sure of these.

        They may come before the speech itself does. Without words it is addressees alone that are told, if any are.
        """
        is_announced = bool(words.text) or words.to is None
        last = person.speeches[-1] if person.speeches else None
        if last is not None and words.began < last.until:
            return Worded(
                actor=words.actor, since=last.since, text="", is_announced=is_announced, is_echo=is_echo,
                to=words.to,
            )  # fmt: skip
        return None if words.to is None else Worded(actor=words.actor, since=words.began, text="", to=words.to)

    def speech(self, words: TimedWords) -> list[ActionBegan | ActionEnded]:
        """The speech that words without any are by themselves, as actions."""
        began, ended = Stamp(self._clock, words.began), Stamp(self._clock, max(words.began, words.ended))
        return [
            ActionBegan(actor=words.actor, action="speak", at=began, confidence=words.confidence),
            ActionEnded(actor=words.actor, action="speak", at=ended),
        ]

    def join(self, other: str, kept: str) -> None:
        """Take two persons for one, who is `kept` from now on."""
        if (said := self._people.pop(other, None)) is not None:
            person = self._people.setdefault(kept, _Person())
            person.speeches = sorted([*person.speeches, *said.speeches], key=_since)[-SPEECHES_KEPT:]
            for id, known in said.utterances.items():
                person.utterances[id] = known

    def forget(self, actor: str) -> None:
        self._people.pop(actor, None)


def _since(speech: _Speech) -> Seconds:
    return speech.since
