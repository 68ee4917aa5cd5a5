"""Which words belong to which event: random talk of several people, recomputed from the definition.

Times are whole tenths of a second, and the oracle counts in them. It knows what was really said, and nothing of how
recognition goes about it: it looks at the whole of a person's talk once all of it is over.
"""

import random
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple
from unittest import mock

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Event, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent, SignalTurn
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events import session
from engage_hri.services.recognition.perceive.words import WORDS_MARGIN, TimedWords
from engage_hri.services.recognition.recognizer import Perceived, Recognizer
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, stamp, world

PEOPLE = ("ann", "bob", "carl")
MARGIN = round(10 * WORDS_MARGIN)
CONFIG = RecognitionConfig()
WORDS_AFTER, LONGEST_SOUND = 10, 30
"""Tenths of a second after a sound in which its words come, and of the longest that may be none."""
LENGTH = 300
"""Tenths of a second of a talk."""


class Speech(NamedTuple):
    who: str
    began: int
    ended: int


class Message(NamedTuple):
    """A result of a recognizer. known: when it was made. arrives: when recognition gets it."""

    who: str
    id: str
    text: str
    began: int
    ended: int
    known: int
    arrives: int
    final: bool


class Talk(NamedTuple):
    speeches: tuple[Speech, ...]
    turns: tuple[tuple[str, int, int], ...]
    """Whom the robot asks, from when to when."""
    messages: tuple[Message, ...]


def talk(chance: random.Random) -> Talk:
    """People speak whenever they like; a recognizer hears most of it, and is late, in doubt, and repeats itself."""
    speeches, messages = [], []
    for who in PEOPLE:
        at, number = chance.randint(5, 60), 0
        while at < LENGTH:
            ended = at + chance.randint(2, 40)
            speeches.append(Speech(who, at, ended))
            for began, until in pieces(at, ended, chance):
                number += 1
                messages += results(who, f"{who}-{number}", began, until, chance)
            if chance.random() < 0.3:  # a line that was typed, or words whose speech was missed
                number += 1
                began = ended + chance.randint(1, 30)
                until = began + chance.choice((0, 0, chance.randint(1, 20)))
                messages += results(who, f"{who}-{number}", began, until, chance)
            at = ended + chance.randint(1, 60)
    turns, at = [], 10
    while at < LENGTH:
        ended = at + chance.randint(5, 40)
        turns.append((chance.choice(PEOPLE), at, ended))
        at = ended + chance.randint(20, 80)
    return Talk(tuple(speeches), tuple(turns), tuple(messages))


def pieces(began: int, ended: int, chance: random.Random) -> Iterator[tuple[int, int]]:
    """Parts of a speech, as a recognizer cuts it, and mistakes them by up to half a second."""
    if chance.random() < 0.2:
        return
    cuts = sorted({began, ended, *(chance.randint(began, ended) for _ in range(chance.randint(0, 2)))})
    for since, until in pairwise(cuts):
        first = max(0, since + chance.randint(-4, 4))
        yield first, max(first + 1, until + chance.randint(-4, 4))


def results(who: str, id: str, began: int, ended: int, chance: random.Random) -> list[Message]:
    """Partial results, a final one, perhaps a correction; each perhaps twice, and in any order."""
    known, made = ended, []
    for number in range(chance.randint(0, 2)):
        at = chance.randint(began, ended)
        made.append(Message(who, id, f"{id} part {number}", began, at, at, at, False))
    for number in range(chance.choice((1, 1, 2, 3))):
        known += chance.randint(0 if ended == began else 3, 20)
        made.append(Message(who, id, f"{id} final {number}", began, ended, known, known, True))
    told = [each._replace(arrives=each.known + chance.choice((0, 0, 1, 5, 15))) for each in made]
    return told + [
        each._replace(arrives=each.arrives + chance.randint(0, 10)) for each in told if chance.random() < 0.3
    ]


# -- recognition -----------------------------------------------------------------------------------------------


def recognized(story: Talk, *, with_words: bool = True) -> list[ConnectionEvent]:
    """All changes of all events."""
    steps: list[tuple[int, int, Perceived, int]] = []
    for who, began, ended in story.speeches:
        steps.append((began, 1, ActionBegan(actor=who, action="speak", at=stamp(began / 10)), began))
        steps.append((ended, 0, ActionEnded(actor=who, action="speak", at=stamp(ended / 10)), ended))
    for number, (who, began, ended) in enumerate(story.turns):
        turn = f"turn-{number}"
        asked = Event(kind="adjacency_pair", id="e", responder=who, turn=turn)
        over = TurnSignal(id="s", turn=turn, signal="ended", actor=who)
        steps += [
            (began, 2, ActionBegan(actor=ROBOT, action="speak", at=stamp(began / 10), behavior=f"{turn}:s"), began),
            (began, 3, RequestEvent(id=turn, requester="r", block=turn, at=stamp(began / 10), event=asked), began),
            (ended, 2, ActionEnded(actor=ROBOT, action="speak", at=stamp(ended / 10), behavior=f"{turn}:s"), ended),
            (ended, 3, SignalTurn(id=f"{turn}-end", requester="r", signal=over, at=stamp(ended / 10)), ended),
        ]
    for each in story.messages if with_words else ():
        heard = TimedWords(
            actor=each.who, id=each.id, text=each.text, began=each.began / 10, ended=each.ended / 10, final=each.final
        )
        steps.append((each.arrives, 4, heard, each.known))
    with mock.patch.object(session, "WORDS_PATIENCE", 1e6):
        recognizer = Recognizer(ROBOT, CONFIG)
    told = recognizer.feed(world(*PEOPLE), 0.0, 0.0)
    for now, _, observation, at in sorted(steps, key=lambda step: step[:2]):
        while (due := recognizer.deadline) is not None and due < now / 10:
            told += recognizer.advance(due)
        told += recognizer.feed(observation, at / 10, now / 10)
    told += recognizer.advance(1e6)
    return [each for each in told if isinstance(each, ConnectionEvent)]


# -- the oracle ------------------------------------------------------------------------------------------------


def texts(story: Talk) -> dict[tuple[str, int], str]:
    """Words of each speech, by person and beginning, words alone included."""
    said: dict[tuple[str, int], str] = {}
    for who in PEOPLE:
        speeches = [each for each in story.speeches if each.who == who]
        place: dict[str, int] = {}
        newest: dict[str, Message] = {}
        finals = [each for each in story.messages if each.who == who and each.final]
        for each in sorted(finals, key=lambda message: (message.arrives, story.messages.index(message))):
            if each.id not in place:
                chosen = belongs(each, speeches)
                if chosen is None:
                    chosen = each.began
                    speeches.append(Speech(who, each.began, each.ended))
                place[each.id] = chosen
            if each.id not in newest or each.known > newest[each.id].known:
                newest[each.id] = each
        for began in {each.began for each in speeches}:
            parts = sorted((newest[id].began, id, newest[id].text) for id, speech in place.items() if speech == began)
            said[who, began] = " ".join(text for _, _, text in parts)
    return said


def belongs(message: Message, speeches: list[Speech]) -> int | None:
    """The beginning of the speech that a message overlaps longest, as far as speeches were known when it came."""
    best: tuple[int, int] | None = None
    for _, began, ended in sorted(speeches):
        if began > message.arrives:
            continue
        until = ended if ended <= message.arrives else 10**9
        common = min(message.ended, until) - max(message.began, began)
        allowed = 0 if message.began == message.ended else -MARGIN
        if common >= allowed and (best is None or common >= best[0]):
            best = (common, began)
    return None if best is None else best[1]


def lives(changes: list[ConnectionEvent]) -> list[list[ConnectionEvent]]:
    """All changes of each event, by its id: in which order events are told of may depend on when words come."""
    found: dict[str, list[ConnectionEvent]] = {}
    for change in changes:
        found.setdefault(change.id, []).append(change)
    return [found[id] for id in sorted(found)]


def expected_words(
    life: list[ConnectionEvent], said: dict[tuple[str, int], str], others: list[list[ConnectionEvent]]
) -> str:
    """Words of all speech of which an event consists. others: all events."""
    first = life[0]
    decision = next((change for change in life if change.state != "started"), None)
    who = first.person(ROBOT)
    began = round(first.started.seconds * 10)
    if first.kind == "backchannel":  # one of the robot's has no words of a person
        return said.get((who, began), "") if first.responder == who else ""
    if first.initiator == who:  # until it is decided, further speech is more of the same turn
        end = 10**9 if decision is None else round(decision.at.seconds * 10)
        elsewhere = [each[0] for each in others if each[0].id != first.id and is_speech_of(each[0], who)]
        starts = {round(each.started.seconds * 10) for each in elsewhere}
        # What answers the robot's question to somebody else belongs to that.
        starts |= {
            round(each.at.seconds * 10)
            for life in others
            for each in life
            if each.answered_by == who and not each.retold
        }
        own = {at: text for (speaker, at), text in said.items() if speaker == who and at not in starts}
        parts = sorted((at, text) for at, text in own.items() if began <= at <= end)
        return " ".join(text for _, text in parts if text)
    answered = next((change for change in life if change.response == "speak"), None)
    if answered is None or answered.delay is None:
        return ""
    turn_end = answered.at.seconds - max(0.0, answered.delay)
    if answered.state == "failed":  # a late answer may be known later still: only the limit tells when the turn ended
        turn_end = next(each.at.seconds for each in life if each.state == "failed") - CONFIG.adjacency_pair_limit
    return said.get((answered.answered_by or who, round((turn_end + answered.delay) * 10)), "")


def is_speech_of(event: ConnectionEvent, who: str) -> bool:
    """True if the event begins with speech of this person."""
    return who == (event.responder if event.kind == "backchannel" else event.initiator)


def only_spoken(story: Talk) -> Talk:
    """The same without words that belong to no speech."""
    kept: set[str] = set()
    for who in PEOPLE:
        speeches = [each for each in story.speeches if each.who == who]
        for id in {each.id for each in story.messages if each.who == who}:
            finals = [each for each in story.messages if each.id == id and each.final]
            if all(belongs(each, speeches) is not None for each in finals):
                kept.add(id)
    return story._replace(messages=tuple(each for each in story.messages if each.id in kept))


@settings(max_examples=share_of(80), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_each_event_ends_up_with_the_words_of_its_speech(seed: int) -> None:
    story = only_spoken(heard(talk(random.Random(seed))))
    said = texts(story)

    events = lives(recognized(story))
    for life in events:
        assert life[-1].words == expected_words(life, said, events), life[-1]


@settings(max_examples=share_of(80), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_words_change_nothing_but_words(seed: int) -> None:
    """But for those said while the robot speaks, for sounds without any, and the order in which it is told."""
    story = only_spoken(heard(apart(talk(random.Random(seed)))))
    told: dict[str, ConnectionEvent] = {}
    with_words = []
    for each in recognized(story):
        before, told[each.id] = told.get(each.id), each
        if before is None or not tells_only_words(before, each):
            with_words.append(replace(each, words=""))

    assert in_order(with_words) == in_order(recognized(story, with_words=False))


def in_order(events: list[ConnectionEvent]) -> list[ConnectionEvent]:
    """The same as they happened; the numbers tell in which order they became known."""
    plain = [replace(each, id="") for each in events]
    return sorted(plain, key=lambda each: (each.at.seconds, each.kind, each.initiator, each.responder, each.state))


def apart(story: Talk) -> Talk:
    """Without what somebody says while the robot has a turn."""
    cut = [
        each
        for each in story.speeches
        if any(each.began <= ended and began <= each.ended for _, began, ended in story.turns)
    ]
    return story._replace(speeches=tuple(each for each in story.speeches if each not in cut))


def heard(story: Talk) -> Talk:
    """Without sounds of which no words come within a second: they might be coughs."""

    def is_heard(each: Speech) -> bool:
        finals = [said for said in story.messages if said.who == each.who and said.final]
        soon = [
            said for said in finals if belongs(said, [each]) is not None and said.arrives < each.ended + WORDS_AFTER
        ]
        return bool(soon) or each.ended - each.began > LONGEST_SOUND

    return story._replace(speeches=tuple(filter(is_heard, story.speeches)))


def tells_only_words(before: ConnectionEvent, after: ConnectionEvent) -> bool:
    same = replace(after, words="", at=before.at, retold=before.retold) == replace(before, words="")
    return after.retold and same and after.words != before.words


@settings(max_examples=share_of(80), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_words_alone_are_told_with_the_speech_that_they_are(seed: int) -> None:
    """Here all of it counts: lines that were typed, and words whose speech was missed."""
    story = talk(random.Random(seed))
    said = texts(story)

    events = lives(recognized(story))
    for life in events:
        who = life[-1].answered_by or life[0].person(ROBOT)
        if life[-1].words:
            texts_of_person = {text for (speaker, _), text in said.items() if speaker == who}
            known = {part for text in texts_of_person for part in text.split()}
            assert set(life[-1].words.split()) <= known
        if life[0].kind == "backchannel" or (life[0].initiator == ROBOT and life[-1].response == "speak"):
            assert life[-1].words == expected_words(life, said, events), life[-1]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_an_event_is_told_again_only_with_other_words_or_a_late_answer(seed: int) -> None:
    for life in lives(recognized(talk(random.Random(seed)))):
        for before, after in pairwise(life):
            if after.retold and after.response != before.response:
                assert (before.kind, before.state, after.state) == ("adjacency_pair", "failed", "failed")
                assert before.response is None
            elif after.retold:
                assert tells_only_words(before, after)
