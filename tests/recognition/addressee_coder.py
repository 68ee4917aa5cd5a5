"""A coder of addressees: for whom each speech is, by its words, the looks, and what was said before.

Takes nothing from the code that it judges. Definitions: docs/recognition.md, "To whom people speak".
"""

from collections.abc import Collection
from math import inf

from msgspec.structs import replace

from tests.recognition.coder import BRIEF, LAST, ROUND, WORDS_AFTER, WORDS_WAIT, company, is_noise, longest_sound
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import CALLED, LIMIT, Instant, Span, Timeline

GREETINGS = ("hey", "hello")
"""Words before a name that calls somebody, of those that are drawn."""
SHORT = 3
"""Words up to which a name at the end calls somebody."""
HALF = 0.5


def addressed(timeline: Timeline) -> Timeline:
    """Return the timeline with each speech to whom it is; of sounds without words it makes no difference."""
    rest = [each for each in timeline.spans if each.action != "speak"]
    found = replace(timeline, spans=rest)
    for speech in sorted((each for each in timeline.spans if each.action == "speak"), key=lambda each: each.since):
        found = replace(found, spans=[*found.spans, replace(speech, to=addressee(speech, found))])
    return found


def addressee(speech: Span, before: Timeline) -> str:
    """For whom a speech is; "": nobody knows. before: with looks, turns of the robot, all that was said before."""
    if before.is_first and speech.known is not None and speech.until < speech.known and not _spoken(before):
        found = _looked_at(speech, before) or _answered(speech, before)  # nobody knows that words will come
        return found if found == ROBOT else _called(speech, before) or found
    is_decided = speech.known is not None and _held_at(speech, before) <= speech.known[0]
    if speech.told and (before.tells == "early" or not is_decided):
        return speech.told
    if not is_decided and (called := _called(speech, before)):
        return called
    if speech.is_line or not company(speech, before):
        return ROBOT
    return _looked_at(speech, before) or _answered(speech, before)


def _called(speech: Span, before: Timeline) -> str:
    """Whom the words of a speech call: nobody who is known by another id alone when they come.

    Who is known by the own id, too, and speaks by another calls somebody else, as far as anybody knows.
    """
    at = speech.known or speech.since
    unknown = {each.who for each in before.joins if at < each.at and not (each.is_known or each.changes)}
    is_another = any(each.who == speech.who and at < each.at and each.is_known for each in before.joins)
    people = (ROBOT, *(each for each in before.people if each not in unknown))
    return called_by(speech.words, people, before.unseen, "" if is_another else speech.who)


def called_by(words: str, people: tuple[str, ...], unseen: Collection[str] = (), speaker: str = "") -> str:
    """Who is called: first, last after a comma, or last of a few words. A comma parts words where no blank does.

    unseen: people of whom only the ids are known. speaker: whose own name calls nobody, nor do parts of it.
    """
    said = [each for each in words.replace("、", ", ").replace("。", ". ").split() if any(map(str.isalnum, each))]
    plain = [each.strip(",.!?").casefold() for each in said]
    if plain and plain[0] in GREETINGS:
        plain, said = plain[1:], said[1:]
    plain = [each.removesuffix("さん") for each in plain]
    names = [(name.casefold().split(), who) for who in people for name in (who, CALLED.get(who, ""))
             if name == who or (name and who not in unseen)]  # fmt: skip
    for parts, who in sorted(names, key=lambda each: -len(each[0])):
        rest = said[: -len(parts)]
        is_last = plain[-len(parts) :] == parts and (len(rest) < SHORT or rest[-1].endswith(","))
        if plain[: len(parts)] == parts or is_last:
            if who != speaker:
                return who
            plain = ["" if word in parts else word for word in plain]
    return ""


def _spoken(before: Timeline) -> list[Span]:
    return [each for each in before.spans if each.action == "speak"]


def _held_at(speech: Span, before: Timeline) -> float:
    """When a speech into the robot's turn that goes on is an interruption or the answer, by the look at the robot."""
    for turn in before.turns:
        if speech.who in turn.to and turn.since < speech.since < turn.until:
            decided = speech.since[0] + WORDS_WAIT
            if not before.is_worded:
                decided = min(turn.until[0], speech.since[0] + BRIEF)
            faces = {
                each.to for each in before.spans
                if each.who == speech.who and each.action == "look"
                and each.since[0] <= decided and each.until > speech.since
            }  # fmt: skip
            if speech.until[0] > decided and faces == {ROBOT}:
                return decided
    return inf


def _looked_at(speech: Span, before: Timeline) -> str:
    """Whose face the speaker looks at for more than half of the speech."""
    seconds: dict[str, float] = {}
    for each in before.spans:
        if each.who == speech.who and each.action == "look" and each.to in (ROBOT, *company(speech, before)):
            common = min(each.until[0], speech.until[0]) - max(each.since[0], speech.since[0])
            seconds[each.to] = seconds.get(each.to, 0.0) + max(0.0, common)
    return next((face for face, common in seconds.items() if common > HALF * speech.seconds + ROUND), "")


def _decided(speech: Span, before: Timeline) -> Instant:
    """When it is decided to whom a speech is, and known that it is no cough: with its words, if there are any."""
    none_come = (speech.until[0] + WORDS_AFTER, LAST) if before.is_worded else speech.until
    at_last = round(speech.since[0] + longest_sound(before), 6), LAST  # what is due comes after what is seen then
    return min(max(speech.until, speech.known or none_come), at_last)


def _is_awaited(speech: Span, before: Timeline) -> bool:
    """True if the robot has asked the speaker, and nobody has answered yet, as far as is known then."""
    at = speech.since
    asked = [turn for turn in before.turns if turn.kind == "asks" and speech.who in turn.to and turn.until < at]
    if not asked or asked[-1].is_aborted or at[0] > asked[-1].until[0] + LIMIT + ROUND:
        return False
    since = [
        each for each in before.spans
        if each.to == ROBOT and each.since[0] < at[0] and each.action != "look"
        and (asked[-1].since if each.who in asked[-1].to else asked[-1].until) < each.since
    ]  # fmt: skip
    return not any(
        not is_noise(each, before) and _is_known_by(each, speech, before)
        if each.action == "speak" else not _is_beside_words(each, before)
        for each in since
    )  # fmt: skip


def _is_known_by(each: Span, speech: Span, before: Timeline) -> bool:
    """True if it is known to whom somebody has spoken, and that it was no cough, when another's speech is decided."""
    return each.who == speech.who or _decided(each, before) <= _decided(speech, before)


def _is_noise_by(each: Span, speech: Span, before: Timeline) -> bool:
    """True if no words of somebody's sound are known when it is decided to whom another speech is.

    Late words of one's own say nothing as long as what one has begun before they came may be for the robot.
    """
    is_known = each.known is not None and each.known <= _decided(speech, before)
    said = replace(before, spans=[*before.spans, replace(speech, to=ROBOT)])
    return is_noise(each if is_known else replace(each, known=None), said)


def _calls_another(each: Span, speech: Span, before: Timeline) -> bool:
    """True if somebody calls the speaker by an id of which nobody knows yet that it is the speaker's."""
    at = _decided(speech, before)
    is_another = any(join.who == speech.who and join.is_known and at < join.at for join in before.joins)
    return is_another and not each.told and _called(each, before) == speech.who


def _is_beside_words(sign: Span, before: Timeline) -> bool:
    """True if somebody speaks when a gesture of theirs begins."""
    return any(
        each.who == sign.who and each.action == "speak" and each.since < sign.since < each.until
        for each in before.spans
    )  # fmt: skip


def _answered(speech: Span, before: Timeline) -> str:
    """Who has spoken to the speaker last, or to whom the speaker has; "": neither, as long as an answer may take."""
    at = speech.since[0]
    heard: list[tuple[float, float, str, str]] = []
    for turn in before.turns:
        if speech.who in turn.to:
            heard += [(until[0], since[0], ROBOT, "") for since, until in turn.speech]
    for each in before.spans:
        is_speech = each.action == "speak" and not _is_noise_by(each, speech, before)
        is_theirs = each.who == speech.who or (each.to == speech.who and not _calls_another(each, speech, before))
        if is_speech and is_theirs and _is_known_by(each, speech, before):
            heard.append((each.until[0], each.since[0], each.who, each.to))
    recent = [
        (min(until, at), since, who, to) for until, since, who, to in heard if since < at <= until + LIMIT + ROUND
    ]
    if not recent:
        return ROBOT if _is_awaited(speech, before) else ""
    _, _, who, to = max(recent)
    if who != speech.who:
        return who
    return "" if before.tells and speech.known is None else to  # words would have come with their addressees
