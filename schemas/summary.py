"""Summary of performed fragments in a few hundred characters, for a language model: as `json` or `text`."""

from collections.abc import Iterable
from itertools import groupby
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, HeardText, Interjected
from engage_hri.schemas.recognition import ConnectionEvent, InterjectionReading
from engage_hri.schemas.text import joined
from engage_hri.schemas.units import Seconds

LONGEST_PROBLEM = 160
MOST_PROBLEMS = 4
UNKNOWN_ANSWER = "the answer is not known: the service that was to tell it has gone or was restarted"
MOST_HEARD = 16
"""Utterances that are told, the newest."""
ROUNDING = 2
"""Decimals of seconds."""
_BY = {"words": "words alone", "look": "a look", "pointing": "pointing"}


Status = Literal["done", "interrupted", "failed", "unknown", "refused"]
_WORST_FIRST: tuple[Status, ...] = (
    "unknown", "failed", "interrupted", "refused",
)  # fmt: skip
_STOPS = tuple(".!?…।؟۔။。！？｡")
_CLOSING = "\"'”’»)]」』）】》〉］｝〕"


class Referred(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A reference as it really was made. looked: the person looked there; absent: the robot did not wait for that."""

    object: str
    phrase: str
    """The words of it that were said."""
    by: str
    """`pointing` if the robot pointed, else `a look` if it looked there, else `words alone`."""
    looked: bool | None = None
    delay: Seconds | None = None
    """Time until the person looked there."""


class HeardWords(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Words that somebody said. to: ids of those to whom they were said, if that is known."""

    who: str
    text: str
    to: tuple[str, ...] = ()


class SaidInto(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Words that somebody has said into the turn. reading: what it was taken for; `open`: nobody knows.

    went_on: the robot has gone on with its words after it.
    """

    who: str
    reading: InterjectionReading
    text: str = ""
    went_on: bool = False


class Summary(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Result of a fragment or a turn, short enough for a language model.

    status: the worst of all fragments; `unknown`: a part of the robot has gone, so that more may have been said and
    done than is told here; `refused`: nothing was said or done.
    said: the words that were really spoken.
    references: each object that was referred to, in order.
    eye_contact: the person returned the look at the end of the turn; absent: the turn goes on, or the robot
    did not look.
    answer: the action that answered the turn, `none` if none came in time, `pending` while there is time;
    absent: the turn expects none, or was broken off by other things than words, or recognition has gone.
    answered_by: id of the person who answered.
    heard: what people have said during and after the turn, and before it since the last, in order.
    interjections: what people have said into the turn, in order, and whether the robot has gone on after it.
    problems: what went wrong, in words.
    """

    status: Status
    said: str = ""
    cut_short: bool = False
    """True if words were left unsaid."""
    references: tuple[Referred, ...] = ()
    eye_contact: bool | None = None
    answer: Action | Literal["none", "pending"] | None = None
    answer_delay: Seconds | None = None
    """Time from the end of the turn to the answer; negative for an earlier answer."""
    answered_by: str = ""
    heard: tuple[HeardWords, ...] = ()
    interjections: tuple[SaidInto, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def json(self) -> str:
        """The summary as a JSON object, without what is at its default."""
        return msgspec.json.encode(self).decode()

    @property
    def text(self) -> str:
        """The same in words, on one line."""
        return " ".join(_sentences(self))


def summary(*outcomes: FragmentOutcome) -> Summary:
    """Sum up one fragment, or the fragments of one turn.

    outcomes: in the order of the turn.

    Raises:
        InputRefused: one of them is no outcome of a fragment.
    """
    for each in outcomes:
        if not isinstance(each, FragmentOutcome):
            reason, advice = f"{each!r:.60} is no outcome of a fragment", "what `perform` or `stream` returns"
            raise InputRefused(Fault(reason=reason, where="summary", advice=advice))
    spoken = [each for outcome in outcomes for each in outcome.spoken]
    statuses = {outcome.status for outcome in outcomes}
    events = {event.id: event for outcome in outcomes for event in outcome.events}
    pair = _last(event for event in events.values() if event.kind == "adjacency_pair")
    status: Status = next((each for each in _WORST_FIRST if each in statuses), "done")
    if status == "refused" and statuses != {"refused"}:
        status = "failed"  # something was said or done before
    wrong = [
        text
        for outcome in outcomes
        for text in ([str(outcome.fault)] if outcome.fault else []) + list(outcome.warnings)
    ]
    if pair is not None and pair.state == "lost":
        wrong.append(UNKNOWN_ANSWER)
    return Summary(
        status=status,
        said=joined(each.text for each in spoken),
        cut_short=status != "refused"
        and (any(it.unsaid for it in outcomes) or not all(it.complete for it in spoken)),
        references=tuple(
            Referred(
                object=each.object,
                phrase=each.phrase,
                by=_BY[each.by],
                looked=each.looked,
                delay=_rounded(each.delay),
            )
            for outcome in outcomes
            for each in outcome.references
            if each.by != "nothing"
        ),
        eye_contact=next((each.eye_contact for each in reversed(outcomes) if each.eye_contact is not None), None),
        answer=_answer(pair, is_over=status != "done"),
        answer_delay=_rounded(pair.delay) if pair and pair.response else None,
        answered_by=(pair.answered_by or pair.responder) if pair and pair.response else "",
        heard=_heard(text for outcome in outcomes for text in outcome.heard),
        interjections=_interjections(each for outcome in outcomes for each in outcome.interjections),
        problems=_problems(wrong),
    )


def _last(events: Iterable[ConnectionEvent]) -> ConnectionEvent | None:
    """The last event. One that was lost may have gone on as another, since the same instant."""
    return max(events, key=lambda event: (event.started.seconds, event.state != "lost"), default=None)


def _answer(pair: ConnectionEvent | None, *, is_over: bool) -> Action | Literal["none", "pending"] | None:
    """Answer to the turn, as in `Summary`. is_over: the turn ended early, so no answer is waited for any more."""
    if pair is None or pair.state in ("lost", "withdrawn") or (is_over and pair.state == "started"):
        return None
    if pair.state == "started":
        return "pending"
    return pair.response or "none"


def _heard(texts: Iterable[HeardText]) -> tuple[HeardWords, ...]:
    """Words in order; fragments of one turn tell some of them again."""
    newest = {(each.actor, each.id, each.began): each for each in texts}
    said = sorted(newest.values(), key=lambda each: (each.began.seconds, each.actor, each.id))
    return tuple(HeardWords(who=each.actor, text=each.text, to=each.to) for each in said[-MOST_HEARD:])


def _interjections(all_told: Iterable[Interjected]) -> tuple[SaidInto, ...]:
    """Speech into the turn, in order; fragments of one turn tell some of it again."""
    newest = {(each.actor, each.since): each for each in all_told}
    return tuple(
        SaidInto(who=each.actor, reading=each.reading, text=each.words, went_on=each.went_on)
        for each in newest.values()
    )


def _problems(texts: Iterable[str]) -> tuple[str, ...]:
    told = tuple(dict.fromkeys(map(_shortened, texts)))
    left = len(told) - MOST_PROBLEMS
    return told if left <= 0 else (*told[:MOST_PROBLEMS], f"and {left} more")


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_PROBLEM else f"{text[: LONGEST_PROBLEM - 3]}..."


def _rounded(seconds: Seconds | None) -> Seconds | None:
    return None if seconds is None else round(seconds, ROUNDING) + 0.0  # no negative zero


def _sentences(it: Summary) -> Iterable[str]:
    if it.status == "refused":
        yield "Refused, nothing was said or done."
    elif it.status == "unknown":
        yield "A part of the robot has gone: it is unknown what became of the fragment."
    elif it.status != "done":
        yield f"The fragment {'failed' if it.status == 'failed' else 'was interrupted'}."
    if it.said:
        stop = "" if it.said.rstrip(_CLOSING).endswith(_STOPS) else "."
        how = "Said at least" if it.status == "unknown" else "Only said" if it.cut_short else "Said"
        yield f'{how}: "{it.said}"{stop}'
    elif it.status not in ("refused", "unknown"):
        yield "Nothing was said."
    for each in it.references:
        yield f"{each.object}: {each.phrase or 'no words'}, by {each.by}; {_look(each)}."
    if it.eye_contact is not None:
        yield f"At the end they {'looked' if it.eye_contact else 'did not look'} at the robot."
    match it.answer:
        case "pending":
            yield "No answer yet."
        case "none":
            yield "No answer came."
        case str() as action:
            yield f"Answered by {it.answered_by}: {action}, after {it.answer_delay or 0.0:g} s."
    for into in it.interjections:
        text = f' "{into.text}"' if into.text else ""
        how = "the robot went on" if into.went_on else "the robot broke off"
        yield f"{into.who} spoke into it ({into.reading}){text}: {how}."
    for who, said in groupby(it.heard, key=lambda each: each.who):
        yield f'Heard from {who}: "{" ".join(each.text for each in said)}"'
    if it.problems:
        yield f"Problems: {'; '.join(it.problems)}."


def _look(each: Referred) -> str:
    if each.looked is None:
        return "not waited for their look"
    return f"they looked after {each.delay or 0.0:g} s" if each.looked else "they did not look"
