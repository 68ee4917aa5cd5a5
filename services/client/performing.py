"""Requests of a client that a robot performs: fragments of turns, and blocks past the policies."""

from collections.abc import Iterable
from typing import TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Constraint
from engage_hri.schemas.blocks import Block, BlockOutcome, Composition, PerformBlock
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.fragments import FragmentOutcome, HeardText, PerformFragment, TurnClosed, TurnFragment
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.inputs import (
    BlockSource,
    FragmentSource,
    block_in,
    checked,
    fragment_in,
    listed,
    taken,
)
from engage_hri.services.client.orders import OrderedRobot
from engage_hri.services.requests.ends import Pending, Requester

ANSWER_PATIENCE = 40.0
"""Seconds after a fragment's end for which `await_answer` waits: longer than an answer takes, and its words."""


UTTERANCES_KEPT = 256
"""Number of utterances of which a reader of outcomes is known to have been told."""


class PerformFailed(RunFailed):
    """A fragment or block failed while it ran, or what performed it has gone, so that its end is unknown.

    `outcome` tells what was done of it, as far as is known, and its `status` which of the two; `fault` tells why.
    """

    def __init__(self, fault: Fault, outcome: FragmentOutcome | BlockOutcome) -> None:
        super().__init__(fault)
        self.outcome = outcome


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
        while len(self._told) > UTTERANCES_KEPT:
            del self._told[next(iter(self._told))]
        return new


class PerformingRobot(OrderedRobot):
    """A robot that performs what a participant of its bus asks for: base of `Robot`, which is also followed."""

    def __init__(self, bus: Bus, requests: Requester) -> None:
        super().__init__(bus, requests)
        self._words = NewWords()

    async def perform(
        self,
        fragment: FragmentSource,
        *,
        addressee: str | tuple[str, ...] | None = None,
        interruptible: bool | str | tuple[str, ...] | None = None,
        await_answer: bool = False,
        timeout: Seconds | None = None,
    ) -> FragmentOutcome:
        """Perform a turn fragment; returns when it is done or was interrupted.

        fragment: a `TurnFragment`, the path of a file with EBML or JSON, such a text itself, or JSON as a dict; also
        the tool input of a language model.
        addressee: to whom, in place of what the fragment says: an id, several, or `*` for all; None: as it says.
        interruptible: who may interrupt it, in place of what the fragment says: ids, `*`, True for those spoken to,
            False for nobody; None: as it says.
        await_answer: if it ends a turn, return only when that has been answered, or it is too late; `events` tell,
            and `heard` has the words.
        timeout: seconds to wait for it to be accepted, for example until generation is there; None: for ever.

        Raises:
            InputRefused: the fragment is wrong, or cannot be performed now. Nothing has moved.
            PerformFailed: it began, and failed.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        taken(timeout, Seconds | None, "timeout")
        parsed = fragment_in(fragment, self._unnamed())
        if addressee is not None:
            parsed = replace(parsed, addressee=addressee)
        if interruptible is not None:
            parsed = replace(parsed, interruptible=interruptible)
        return await self._end_of(self._send(parsed), await_answer=await_answer, timeout=timeout)

    def _send(self, fragment: TurnFragment) -> Pending:
        request = PerformFragment(id=self._request_id(fragment.id), fragment=fragment)
        return self._requests.send(keys.FRAGMENT, checked(keys.FRAGMENT, request))

    async def _end_of(
        self, pending: Pending, *, await_answer: bool, timeout: Seconds | None = None
    ) -> FragmentOutcome:
        """Return the outcome of a fragment that was sent in this very step, as `perform` does."""
        assert isinstance(pending.request, PerformFragment)
        fragment = pending.request.fragment
        awaits_answer = await_answer and fragment.turn_status in ("end", "full")
        outcome = await (self._answered(pending, timeout) if awaits_answer else self._performed(pending, timeout))
        return _successful(self._with_new_words(outcome), fragment.id)

    def _unnamed(self) -> str:
        """Make the id of a fragment or block that has none."""
        return f"{self._bus.name}-{self._life}-{next(self._numbers)}"

    def begin_to_perform(self, fragment: FragmentSource) -> None:
        """Send a fragment and do not wait for what becomes of it.

        fragment: as for `perform`; a fault that only generation can find is told on `faults`.

        Raises:
            InputRefused: it is no fragment, or a value in it is of the wrong type. Nothing was sent.
        """
        self._send(fragment_in(fragment, self._unnamed()))

    async def _performed(self, pending: Pending, timeout: Seconds | None) -> FragmentOutcome:
        outcome = await self._finished(pending, timeout)
        assert isinstance(outcome, FragmentOutcome)
        return outcome

    async def _answered(self, pending: Pending, timeout: Seconds | None) -> FragmentOutcome:
        fragment = pending.request.fragment  # type: ignore[attr-defined]
        with self._feed((TurnClosed, PeerGone), keys.TURN_CLOSED, keys.ANY_ROBOT_ALIVE) as news:
            outcome = await self._performed(pending, timeout)
            events = {event.id for event in outcome.events}
            deadline = self.now() + ANSWER_PATIENCE + (fragment.within or 0.0)
            while (told := await news.next(max(0.0, deadline - self.now()))) is not None:
                if isinstance(told, PeerGone):
                    if told.participant == "generation":
                        return _without_an_answer(outcome)
                # An earlier turn of the same name, told again, has other events.
                elif fragment.id in told.fragments and events <= {event.id for event in told.events}:
                    return replace(outcome, events=told.events, heard=told.heard, interjections=told.interjections)
        return outcome

    async def realize(
        self,
        block: BlockSource,
        behaviors: Iterable[BlockBehavior] = (),
        constraints: Iterable[Constraint] = (),
        *,
        composition: Composition = "MERGE",
        follows: Iterable[str] = (),
        timeout: Seconds | None = None,
    ) -> BlockOutcome:
        """Realize a BML block, past the policies: `realize(block)`, or `realize("greet", [Gaze(...), ...])`.

        block: a whole block, the path of a file with BML or JSON, such a text itself, or JSON as a dict; or the id of
            the block to make of the other arguments.
        behaviors: of the block to make; without any, `block` is no id.
        constraints: between the sync points of these behaviors.
        composition: beside what runs (`MERGE`), after it (`APPEND`), or in its place (`REPLACE`).
        follows: ids of live blocks; when one of them fails or is ended, this block ends, too.
        timeout: seconds to wait for it to be accepted; None: for ever.

        Raises:
            InputRefused: the block is wrong as a whole. Nothing has moved.
            PerformFailed: it began, and failed.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        if isinstance(block, str) and (parts := listed(behaviors, "behaviors")):
            between = listed(constraints, "constraints")
            made = Block(id=block, behaviors=parts, constraints=between, composition=composition)
        else:
            made = block_in(block, self._unnamed())
        request = PerformBlock(id=self._request_id(made.id), block=made, follows=listed(follows, "follows"))
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BlockOutcome)
        return _successful(outcome, made.id)

    def _with_new_words(self, outcome: FragmentOutcome) -> FragmentOutcome:
        """Leave out of an outcome what this client has been told by an earlier one."""
        return replace(outcome, heard=self._words.of(outcome.heard))


O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


def _successful(outcome: O, subject: str) -> O:
    """Return the outcome, or raise PerformFailed if it says so. subject: id of the fragment or block."""
    if outcome.status in ("failed", "unknown"):
        raise PerformFailed(outcome.fault or Fault(reason="it failed", where=subject), outcome)
    return outcome


def _without_an_answer(outcome: FragmentOutcome) -> FragmentOutcome:
    """The outcome of a fragment that was performed, but of which nobody will tell how it was answered."""
    events = tuple(replace(each, state="lost") if each.state == "started" else each for each in outcome.events)
    return replace(outcome, events=events)
