"""Laws about what is told: one end, each point once and in order, losses with their reasons, the words."""

from collections import Counter
from collections.abc import Iterator

from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress, WarningFeedback
from tests.judge.case import Case, Finding

HARMLESS = ("LATE", "DEGRADED")
"""Kinds of warnings with which a behavior is made all the same."""


def one_end(case: Case) -> Iterator[Finding]:
    """Each block ends exactly once, and its feedback says the same."""
    record = case.record
    for block in case.blocks:
        ends, starts = record.ends.get(block, []), record.progress(block, "start")
        told = record.progress(block, "end")
        if not ends:
            yield Finding("hang", block, "no end")
            continue
        if len(ends) > 1 or ends[0].status not in ("done", "failed", "interrupted", "refused"):
            yield Finding("end", block, f"ends: {[(end.status, end.reason) for end in ends]}")
            continue
        if len(starts) > 1 or len(told) != len(starts):
            yield Finding("end", block, f"{len(starts)} starts and {len(told)} ends were told")
        elif told and told[0].status != ends[0].status:
            yield Finding("end", block, f"feedback says {told[0].status!r}, the outcome {ends[0].status!r}")
        if ends[0].status == "refused" and (starts or not record.warnings(block)):
            yield Finding("end", block, "refused after it began, or without a warning")
        if ends[0].status == "done" and not starts:
            yield Finding("end", block, "done, and never begun")
        outcome, asked = ends[0].outcome, case.blocks[block].behaviors
        if outcome is not None and outcome.status == "done" and asked and set(outcome.dropped) >= set(asked):
            yield Finding("end", block, "done, and every behavior was dropped")
    for error in record.errors:
        yield Finding("crash", "", error)


def points(case: Case) -> Iterator[Finding]:
    """Default points come once each and in order; all of them, if the block is done and nothing is said of a loss."""
    record = case.record
    for id, block in case.blocks.items():
        told: dict[str, list[SyncPointProgress]] = {}
        for each in record.points(id):
            told.setdefault(each.behavior, []).append(each)
        for behavior in told.keys() - block.behaviors.keys():
            yield Finding("points", id, f"points of {behavior}, which it does not have")
        for behavior, asked in block.behaviors.items():
            seen = [each.sync for each in told.get(behavior, [])]
            if seen != list(asked.points[: len(seen)]):
                yield Finding("points", id, f"{behavior}: told {seen}")
            times = [each.at.seconds for each in told.get(behavior, [])]
            if times != sorted(times):
                yield Finding("points", id, f"{behavior}: back in time: {times}")
            is_whole = len(seen) == len(asked.points)
            if record.status(id) == "done" and not is_whole and (id, behavior) not in case.lost:
                yield Finding("points", id, f"{behavior}: done, not lost, and only {seen} told")
        yield from _after_the_end(case, id)


def _after_the_end(case: Case, block: str) -> Iterator[Finding]:
    is_over = False
    for each in case.record.told:
        message = each.message
        if getattr(message, "block", None) != block:
            continue
        if is_over and isinstance(message, SyncPointProgress):
            yield Finding("points", block, f"{message.behavior}:{message.sync} told after the block's end")
        is_over = is_over or (isinstance(message, BlockProgress) and message.progress == "end")


def losses(case: Case) -> Iterator[Finding]:
    """What was dropped or interrupted has its one warning, and nothing that is required is lost in a done block."""
    record = case.record
    for id, block in case.blocks.items():
        outcome = record.outcome(id)
        if outcome is None:
            continue
        grave = _of_losses(case, id)
        for behavior in (*outcome.dropped, *outcome.interrupted):
            if grave[behavior] != 1:
                yield Finding("losses", id, f"{behavior} is lost, with {grave[behavior]} warnings")
        if outcome.status != "done":
            continue
        places = [term.place for each in block.relations if each.required for term in each.terms]
        named = {place.behavior for place in places if place.block == id}
        required = {each.id for each in block.behaviors.values() if each.required} | named
        for behavior in sorted(required.intersection(outcome.dropped)):
            yield Finding("required", id, f"{behavior} was dropped, and the block is done")


def _of_losses(case: Case, block: str) -> Counter[str]:
    """How many warnings of a loss there are, by behavior.

    A speech that gives up a time is told with the kind of what cannot be scheduled; it may be lost later, for another
    reason.
    """
    kinds: dict[str, list[str]] = {}
    for each in case.record.warnings(block):
        if each.kind not in HARMLESS:
            kinds.setdefault(each.behavior, []).append(each.kind)
    counts: Counter[str] = Counter()
    for behavior, all in kinds.items():
        is_speech = behavior in case.blocks[block].speeches
        others = [kind for kind in all if kind != "IMPOSSIBLE_TO_SCHEDULE"]
        counts[behavior] = len(others) if is_speech and others else len(all)
    return counts


def talked_over(case: Case) -> Iterator[Finding]:
    """No words are lost because another block is speaking: they wait.

    Within one block an author may ask for both at once, and of blocks that are tied to each other.
    """
    record = case.record
    for told in record.told if case.is_told_true else ():
        message = told.message
        if not (isinstance(message, WarningFeedback) and "the voice is busy" in message.message):
            continue
        block, speaking = message.block, set[str]()
        tied = {term.place.block for each in case.blocks[block].relations for term in each.terms}
        if tied & case.blocks.keys() - {block}:
            continue
        for point in record.points(block):
            if point.behavior in case.blocks[block].speeches and point.at.seconds <= told.at:
                (speaking.discard if point.sync == "end" else speaking.add)(point.behavior)
        if not speaking:
            yield Finding("talked over", block, f"{message.behavior}: {message.message}")


def robbed(case: Case) -> Iterator[Finding]:
    """A stroke, or an arrival, is never lost to a behavior of whatever block: that waits, uses the other arm, or is
    dropped before anything of it begins.
    """
    for told in case.record.told if case.is_exact else ():
        message = told.message
        if isinstance(message, WarningFeedback) and "another behavior took its part" in message.message:
            yield Finding("robbed", message.block or "", f"{message.behavior}: {message.message}", message.behavior)


def words(case: Case) -> Iterator[Finding]:
    """What the outcome says was said is what the voice has said: all, or the words before it was ended."""
    if case.story.faults.get("mute") or not case.is_told_true:
        return
    heard: dict[tuple[str, str], int] = {}
    for word in case.record.words:
        heard[word.block, word.behavior] = word.position
    for id, block in case.blocks.items():
        outcome = case.record.outcome(id)
        if outcome is None:
            continue
        said = {each.behavior: each for each in outcome.spoken}
        for behavior in block.speeches:
            text = block.behaviors[behavior].words
            voice = text[: heard.get((id, behavior), 0)]
            told = said.get(behavior)
            if (told.text if told else "").strip() != voice.strip():
                yield Finding("words", id, f"{behavior}: heard {voice!r}, told {told.text if told else None!r}")
            is_whole = voice.strip() == text
            if told and told.complete and not is_whole:
                yield Finding("words", id, f"{behavior}: complete is {told.complete}, heard {voice!r} of {text!r}")
            if outcome.status == "done" and (id, behavior) not in case.lost and not is_whole:
                yield Finding("words", id, f"{behavior}: done, and only {voice!r} of {text!r} was heard")
