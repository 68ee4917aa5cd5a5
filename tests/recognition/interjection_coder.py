"""A coder of what people say into the robot's turns: told as open, and decided once.

Takes nothing from the code that it judges. Definitions: docs/connection-events.md, "What people say into the robot's
words"; docs/recognition.md, "Backchannel".
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import inf

from msgspec import Struct

from engage_hri.schemas.recognition import Interjection
from tests.recognition.coder import (
    BRIEF,
    LAST,
    ROUND,
    WORDS_AFTER,
    WORDS_WAIT,
    Coded,
    has_spoken_since,
    is_noise,
    longest_sound,
)
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import LISTENING, Instant, Span, Timeline, Turn

SETTLED = 0.4
LATER = {
    ("noise", "backchannel"),
    ("noise", "interruption"),
    ("backchannel", "interruption"),
    ("noise", "answer"),
    ("noise", "other"),
    ("interruption", "backchannel"),
}
"""What words that come late make of what was decided."""


class Into(Struct):
    """A speech into the robot's words. until: end of these. is_beside: they are to others."""

    speech: Span
    turn: Turn
    until: Instant
    is_beside: bool


def judged(timeline: Timeline, told: list[Interjection], events: Sequence[Coded]) -> Iterator[str]:
    """What is told of them and is not so. events: those that are coded."""
    lives: dict[tuple[str, float], list[Interjection]] = {}
    for each in told:
        lives.setdefault((each.actor, round(each.since.seconds, 5)), []).append(each)
    for (actor, since), life in lives.items():
        readings = [each.reading for each in life]
        plain = [one for number, one in enumerate(readings) if not number or readings[number - 1] != one]
        if "open" in plain[1:]:
            yield f"{actor} at {since}: open again after it was decided: {plain}"
        if plain[-1] == "open":
            yield f"{actor} at {since}: never decided"
        decided = plain[plain[0] == "open" :]
        for before, after in pairwise(decided):
            if (before, after) not in LATER:
                yield f"{actor} at {since}: decided twice: {plain}"
    speeches = {(each.who, round(each.since[0], 5)) for each in timeline.spans if each.action == "speak"}
    yield from (f"{who} at {since}: said nothing then" for who, since in lives.keys() - speeches)
    into = {(one.speech.who, round(one.speech.since[0], 5)): one for one in _into(timeline)}
    for key, one in into.items():
        life = lives.get(key, [])
        coded = _reading(one, timeline, _answered_since(one, events))
        last = life[-1].reading if life else ""
        if one.is_beside and timeline.tells == "late":
            coded = {*coded, ""}  # to whom it is may be known when the robot is silent
        elif coded == {"noise"} and (one.is_beside or _looks_at_neighbor(one.speech, timeline)):
            coded = {*coded, ""}  # to whom it is may never be known
        if last not in coded:
            yield f"{key[0]} at {key[1]}{' beside' * one.is_beside}: told {last!r}, coded {sorted(coded)}"
        elif (
            not one.is_beside
            and not one.speech.is_alone
            and not _looks_at_neighbor(one.speech, timeline)
            and (life[0].reading, life[0].at.seconds > key[1] + SETTLED) != ("open", False)
        ):
            yield f"{key[0]} at {key[1]}: not open at once, {life[0]}"
    for key in lives.keys() & speeches - into.keys():
        if lives[key][-1].reading not in ("other", "noise"):
            yield f"{key[0]} at {key[1]}: not to the robot: {[each.reading for each in lives[key]]}"


def _looks_at_neighbor(speech: Span, timeline: Timeline) -> bool:
    """True if somebody looks at another face than the robot's when they begin to speak."""
    return any(
        each.who == speech.who and each.action == "look" and each.to != ROBOT
        and each.since[0] <= speech.since[0] < each.until[0] + SETTLED
        for each in timeline.spans
    )  # fmt: skip


def _into(timeline: Timeline) -> Iterator[Into]:
    """What people say to the robot into its words."""
    for speech in timeline.spans:
        if speech.action == "speak" and speech.to == ROBOT:
            for turn in timeline.turns:
                if speech.who in turn.to and turn.since < speech.since < turn.until:
                    yield Into(speech, turn, turn.until, is_beside=False)
                for since, until in turn.speech:
                    if speech.who not in turn.to and since < speech.since < until:
                        yield Into(speech, turn, until, is_beside=True)


def _goes_with_words_before(gesture: Span, turn: Turn, timeline: Timeline) -> bool:
    """True if a gesture goes with words of the person's own that began before the robot's: it says nothing more."""
    return any(
        each.who == gesture.who and each.action == "speak" and each.to == ROBOT
        and each.since < turn.since and each.since < gesture.since < each.until and not is_noise(each, timeline)
        for each in timeline.spans
    )  # fmt: skip


def _answered_since(one: Into, events: Sequence[Coded]) -> float:
    """When the person's own answer to the robot's turn began; infinite: there is none."""
    answered = (
        one.turn.until[0] + each.delay for each in events
        if each.initiator == ROBOT and each.responder == one.speech.who and each.started == one.turn.since[0]
        and each.delay is not None and not each.answered_by
    )  # fmt: skip
    return next(answered, inf)


def _reading(one: Into, timeline: Timeline, answered: float) -> set[str]:
    """What it is. Where two are right it is known in one instant, or too late for one that listens.

    answered: when the answer to the turn began: a gesture later than that, and than the speech, is none.
    """
    speech, turn, known = one.speech, one.turn, one.speech.known
    since, until, over = speech.since[0], speech.until[0], one.until[0]
    by_words = "backchannel" if speech.words in LISTENING else "interruption"
    outlasts = speech.until > one.until
    if speech.is_line:
        return {by_words}
    # In company it may wait until it is known to whom it is, and then has its words.
    is_waiting = len(timeline.people) > 1 and speech.words not in LISTENING
    taken = {"answer", "interruption"} if turn.is_aborted or one.is_beside or is_waiting else {"answer"}
    if not timeline.is_worded:
        longest = BRIEF + ROUND
        if speech.seconds > longest and since + longest < over:
            return {"interruption"}
        return taken if outlasts else {"backchannel"}
    wait = since + WORDS_WAIT + ROUND
    beside = [
        each for each in timeline.spans
        if each.who == speech.who and each.action in ("nod", "shake", "point")
        and turn.since < each.since < speech.until and speech.since < each.until
        and not _goes_with_words_before(each, turn, timeline)
    ]  # fmt: skip
    is_long = speech.seconds > WORDS_WAIT + ROUND and wait < over  # it has been one that interrupts before
    goes_on = [min(since, each.since[0]) for each in beside if turn.until < each.until]
    is_of_answer = not is_long and turn.kind == "asks" and any(each <= answered + ROUND for each in goes_on)
    if is_of_answer and not one.is_beside and not outlasts:
        decided = turn.until if turn.is_aborted else max(turn.until, (wait, LAST))  # a cut decides at once
        return {"answer", by_words if known is not None and known <= decided else "noise"}
    if known is not None and (not outlasts or known < one.until):
        heard = max(wait, until + WORDS_AFTER) if one.is_beside else wait
        is_in_time = known[0] <= heard
        if one.is_beside and one.until < known and is_in_time and by_words != "backchannel":
            return taken
        if is_in_time and has_spoken_since(speech, timeline):  # waited for only if it is not known to whom it is
            return {"noise", by_words, *taken}
        may_correct = turn.kind == "asks" or speech.seconds <= WORDS_WAIT + ROUND  # else it has opened a pair
        if is_in_time or (not one.is_beside and known < turn.until and may_correct):
            return {by_words}
    longest = longest_sound(timeline) if one.is_beside else WORDS_WAIT
    if speech.seconds > longest + ROUND and since + longest + ROUND < over:
        return {"interruption"}
    if outlasts:
        return taken
    if known is None:
        return {"noise"}
    if not one.is_beside and known < turn.until:
        return {by_words}
    is_told = any(each.action != "point" for each in beside)
    if is_told or has_spoken_since(speech, timeline):
        return {"noise"}
    if known < one.until:
        return {by_words}
    if by_words == "backchannel":
        return {by_words}
    return {"answer", by_words} if one.is_beside else {"answer"}
