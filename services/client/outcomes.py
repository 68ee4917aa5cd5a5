"""Outcomes of fragments as a client makes them, and the words that one leaves unsaid. Pure."""

from collections.abc import Iterable
from typing import Literal

from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.faults import EngageError, Fault, OutcomeUnknown
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.tool import Refer, Say
from engage_hri.services.client.chunking import Chunk
from engage_hri.services.client.performing import PerformFailed


def unreadable(reason: str, id: str) -> Fault:
    """The fault of pieces that cannot be spoken. id: of the turn."""
    told = reason if len(reason) <= 200 else f"{reason[:197]}..."
    return Fault(reason=told, where=id, advice="an `async def` that yields text; or `perform_call`")


def outcome_of(error: EngageError, id: str, unsaid: tuple[str, ...] = ()) -> FragmentOutcome:
    """The outcome of a fragment for which `Robot.perform` raised `error`. unsaid: ids of what has words in it."""
    if isinstance(error, PerformFailed) and isinstance(error.outcome, FragmentOutcome):
        return error.outcome
    is_unknown = isinstance(error, OutcomeUnknown)
    status: Literal["unknown", "refused"] = "unknown" if is_unknown else "refused"
    return FragmentOutcome(id=id, fragment=id, status=status, unsaid=unsaid, fault=error.fault)


def unsaid(fragment: TurnFragment, outcome: FragmentOutcome | None) -> Iterable[str]:
    """Words of a fragment that were not said."""
    spoken = {each.behavior: each for each in outcome.spoken} if outcome else {}
    unsaid = {*outcome.unsaid} if outcome else {*fragment.worded}
    for behavior in fragment.behaviors:
        if isinstance(behavior, Reference) and behavior.id in unsaid:
            yield f"[{behavior.target}]"
        elif isinstance(behavior, Speech):
            said = spoken.get(behavior.id)
            if behavior.id in unsaid:
                yield behavior.text
            elif said is not None and not said.complete:
                yield " ".join(behavior.text.split()[len(said.text.split()) :])


def texts(chunk: Chunk) -> Iterable[str]:
    return (
        part.say if isinstance(part, Say) else f"[{part.refer}]" for part in chunk if isinstance(part, Say | Refer)
    )
