"""A turn of the robot as an object: what is said and shown in it while it lasts, and what became of it at its end.

    async with robot.turn(to="ann") as turn:
        await turn.say("Hello. I am looking for")
        seen = await turn.refer("cup")
        answer = await turn.ask("Do you see it?", within=6)
    print(turn.said, turn.unsaid, turn.answer)

The turn owns the body of its `async with`, as `asyncio.timeout` does: when somebody takes the floor, or the turn
fails, the body is left where it waits. So nobody writes on for a turn that is over, and no line has to ask whether it
is. A body that is left by an error, or whose task is cancelled, stops the robot at a word; what was said is known
before the error goes on. Nothing else goes to the bus than fragments, each with a request, as from `Robot.perform`.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Iterable
from contextlib import suppress
from functools import cached_property
from types import TracebackType
from typing import Any, Generic, Literal, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, OutcomeUnknown
from engage_hri.schemas.fragments import FragmentOutcome, ReferenceMade, TurnClosed, TurnFragment, TurnStatus
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.text import joined
from engage_hri.schemas.tool import ANSWERS, Certainty, Expects, Part, Refer, ToolInput, fragment_of
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import TOGETHER
from engage_hri.services.client.chunking import Chunk, Chunker
from engage_hri.services.client.feeds import Feed, WorldFeed
from engage_hri.services.client.inputs import shown
from engage_hri.services.client.known_objects import KnownObjects
from engage_hri.services.client.outcomes import outcome_of, texts, unreadable, unsaid
from engage_hri.services.client.performing import PerformingRobot
from engage_hri.services.requests.ends import Patience, Pending
from engage_hri.services.text.marks import Ids

Piece = str | Part
"""A bit of text, however short, in which `[id]` refers to an object; or a part by itself."""
SETTLED: Seconds = 1.0
"""Silence after which a finished sentence is sent: bits of one sentence come faster, a look-up takes longer."""
STOP_PATIENCE: Seconds = 3.0
"""Time for which a turn that is stopped waits for its outcomes: a word is over in one second, the look in another."""
ANSWER_WITHIN: Seconds = 6.0
"""Time for the answer to a question, as recognition has it for a reply."""
T = TypeVar("T")
Change = Callable[[TurnFragment], TurnFragment]
_UNCHANGED: Change = replace


def _asking(within: Seconds, expects: Expects) -> Change:
    """Make a fragment the question of its turn."""
    return lambda fragment: replace(fragment, turn_index=1, within=within, accept=ANSWERS[expects])


class TurnAnswer(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The answer to a turn. action: what answered it. by: id of the person who did.

    delay: seconds from the end of the turn; below 0 if it began before that.
    text: the words of that person, as far as they are known.
    """

    action: Action
    by: str
    delay: Seconds = 0.0
    text: str = ""


class Sent(Generic[T]):
    """Something of a turn that is on its way: to await until it is done, or not."""

    def __init__(self, doing: "asyncio.Task[Any]", result: Callable[[], T]) -> None:
        self._doing = doing
        self._result = result

    def __await__(self) -> Generator[Any, None, T]:
        yield from asyncio.wait([self._doing]).__await__()
        return self._result()


class RobotTurn:
    """A turn of the robot. Made by `Robot.turn`, used by `async with`; all its methods are for the time in between.

    What is said and shown goes on while the body does other things; who wants to know when it is done awaits it. At
    the end of the body the robot hands over by a look, and the end of `async with` waits for that.

    After it `status` says how it ended, as in `Summary`; `said` and `unsaid` which words were spoken and which were
    not, `answer` what answered it, `references` and `events` what was seen of it.
    """

    def __init__(
        self,
        robot: PerformingRobot,
        id: str,
        turn: ToolInput,
        chunker: Chunker | None = None,
        *,
        await_answer: bool = False,
    ) -> None:
        self.id = id
        self._robot = robot
        self._turn = turn
        self._chunker = chunker or Chunker()
        self._is_awaited = await_answer
        self._question: Change = _UNCHANGED
        self._fragments: list[TurnFragment] = []
        self._performing: list[asyncio.Task[FragmentOutcome]] = []
        self._sent: dict[str, Pending] = {}
        """Fragments that were sent, by id."""
        self._words: list[str] = []
        """Words as they are spoken."""
        self._live: dict[str, list[str]] = {}
        """Those of each fragment."""
        self._first: dict[str, Seconds] = {}
        """When the first word of each fragment was over."""
        self._going: set[str] = set()
        """Fragments whose blocks have begun and not ended."""
        self._begins = asyncio.Event()
        self._news = asyncio.Event()
        """Set when there is another word, or the turn is over."""
        self._line = asyncio.Lock()
        """Held by a fragment from when it is sent until it is accepted: of a turn that is refused no more is sent."""
        self._goes_on = asyncio.Event()
        """Cleared while the turn is held: what comes meanwhile waits."""
        self._goes_on.set()
        self._is_broken = False
        """True once one was not accepted, or ended badly: no more are sent."""
        self._is_finished = False
        self._closed: TurnClosed | None = None
        """Set when the turn was aborted while no piece came."""
        self._left_out: tuple[str, ...] = ()
        self._body: asyncio.Task[Any] | None = None
        """The task whose body this is; None: it has not begun, or is over."""
        self._was_left = False
        self._settling: asyncio.TimerHandle | None = None
        self._is_over = False

    # -- what is said and shown ---------------------------------------------------------------------------------

    def say(self, *pieces: Piece) -> Sent[str]:
        """Say words, and show things; to await: what was said of it, once it is done.

        pieces: text, in which `[id]` refers to an object; or parts, as of the tool of language models.

        Raises:
            InputRefused: the turn has ended, has not begun, or a piece is neither text nor a part.
        """
        return self._whole(pieces, "middle", lambda outcome: joined(each.text for each in outcome.spoken))

    def refer(
        self, object: str, *others: str, certainty: Certainty = "normal", phrases: Iterable[str] = ()
    ) -> Sent[bool | None]:
        """Refer to an object, by words, a look, or a point; to await: whether they have looked there.

        True: they have; False: not in time; None: nothing was shown, or nobody knows. `references` tell more.

        object: its id. others: of what is shown with it at once, by one look and one point at their middle.
        certainty: `high`: it must not be mistaken. phrases: to choose from; none: the robot finds them.

        Raises:
            InputRefused: the turn has ended, or has not begun.
        """
        part = Refer(refer=TOGETHER.join((object, *others)), certainty=certainty, phrases=tuple(phrases))
        return self._whole([part], "middle", lambda outcome: next((each.looked for each in outcome.references), None))

    def ask(
        self, *pieces: Piece, within: Seconds = ANSWER_WITHIN, expects: Expects = "reply"
    ) -> Sent[TurnAnswer | None]:
        """Say the last words of the turn, and hand over; to await: the answer, or None if none has come in time.

        pieces: as of `say`.
        within: seconds that the answer may take.
        expects: does moving a thing answer it?

        Raises:
            InputRefused: the turn has ended, has not begun, or a piece is neither text nor a part.
        """
        self._is_awaited = True
        return self._whole(pieces, "end", lambda outcome: self.answer, _asking(within, expects))

    def expect_answer(self, within: Seconds = ANSWER_WITHIN, expects: Expects = "reply") -> None:
        """Let what was written end as a question: an answer opens there, and nobody waits for it here.

        within: seconds that the answer may take.
        expects: does moving a thing answer it?
        """
        self._question = _asking(within, expects)

    async def write(self, piece: Piece) -> None:
        """Take a bit of what is being written: each clause is said as soon as it is complete.

        piece: a bit of text, however short, or a part.

        Raises:
            InputRefused: it is neither, or the turn has ended.
        """
        self._check(piece)
        self._unsettle()
        ids = await self._objects.ids(is_needed=isinstance(piece, str) and "[" in piece)
        for chunk in self._chunker.feed(piece, ids):
            self._send(chunk, "middle")
        self._settling = asyncio.get_running_loop().call_later(SETTLED, self._settle, ids)

    async def flush(self) -> None:
        """Say what was written so far to its last word, though nobody knows whether the sentence is complete."""
        self._check()
        self._unsettle()
        if chunk := self._chunker.rest(await self._objects.ids(is_needed=False)):
            self._send(chunk, "middle")

    async def spoken(self) -> None:
        """Wait until the robot has said and done all that it was given so far."""
        if pending := [task for task in self._performing if not task.done()]:
            await asyncio.wait(pending)

    async def hold(self) -> None:
        """Hold the turn: speech waits between two words, movements where they can, until `resume`.

        Raises:
            RunFailed: the realizer is gone.
        """
        self._goes_on.clear()
        await self._steer(self._robot.hold)

    async def resume(self) -> None:
        """Let the turn go on where it was held. Errors as of `hold`."""
        await self._steer(self._robot.resume)
        self._goes_on.set()

    async def stop(self) -> None:
        """End the turn at once: the robot stops at a word. Returns when it has, and `said` is known."""
        self._is_broken = self._is_finished = True
        if asyncio.current_task() is self._body:
            self._body = None
        else:
            self._leave()
        self._goes_on.set()
        self._unsettle()
        for id in reversed(self._sent):
            if not self._sent[id].outcome.done():
                self._robot._requests.cancel(self._sent[id].request.id, "the turn was stopped")
        if self._performing:
            await asyncio.wait(self._performing, timeout=STOP_PATIENCE)

    @property
    def is_performed(self) -> bool:
        """True while something of it is being said or shown."""
        return bool(self._going)

    async def begun(self) -> None:
        """Wait until the robot begins to say or show something of it."""
        await self._begins.wait()

    async def words(self) -> AsyncIterator[str]:
        """Follow the words as they are spoken, from the first one, until the turn is over."""
        told = 0
        while not (self._is_over and told == len(self._words)):
            while told < len(self._words):
                told += 1
                yield self._words[told - 1]
            if not self._is_over:
                self._news.clear()
                await self._news.wait()

    # -- what became of it --------------------------------------------------------------------------------------

    @property
    def said(self) -> str:
        """The words that were really spoken, so far."""
        return self.said_between(0)

    @property
    def unsaid(self) -> str:
        """The words that were to be spoken and were not; an object in brackets where its phrase was not said."""
        return self.unsaid_between(0)

    @property
    def mark(self) -> int:
        """A place in the turn: behind all that was sent so far, for `said_between` and its like."""
        return len(self._fragments)

    def said_between(self, first: int, last: int | None = None) -> str:
        """Return the words that were really spoken between two marks.

        first, last: how many fragments were sent before, as of `mark`; None: up to the end.
        """
        return joined(text for fragment in self._fragments[first:last] for text in self._said_of(fragment))

    def unsaid_between(self, first: int, last: int | None = None) -> str:
        """Return the words between two marks that were not spoken.

        first, last: how many fragments were sent before, as of `mark`; None: up to the end.
        """
        outcomes = {each.fragment: each for each in self.outcomes} if self._is_over else {}
        left = [words for each in self._fragments[first:last] for words in unsaid(each, outcomes.get(each.id))]
        return joined([*left, *(texts(self._rest) if last is None else ())])

    def began_between(self, first: int, last: int | None = None) -> Seconds | None:
        """Return the time at which the first word between two marks was over; None: there is none.

        first, last: how many fragments were sent before, as of `mark`; None: up to the end.
        """
        return min(
            (self._first[each.id] for each in self._fragments[first:last] if each.id in self._first), default=None
        )

    @property
    def outcomes(self) -> tuple[FragmentOutcome, ...]:
        """Outcomes of all fragments that have one; when the turn is over, of all."""
        return self._outcomes if self._is_over else tuple(self._done().values())

    @property
    def summary(self) -> Summary:
        """The turn in a few hundred characters, for a language model."""
        return summary(*self.outcomes)

    @property
    def status(self) -> Literal["", "done", "interrupted", "failed", "unknown", "refused"]:
        """Status at its end, as in `Summary`; empty: it goes on."""
        return self.summary.status if self._is_over else ""

    @property
    def references(self) -> tuple[ReferenceMade, ...]:
        """References as they were made, and whether they have looked."""
        return tuple(made for outcome in self.outcomes for made in outcome.references)

    @property
    def events(self) -> tuple[ConnectionEvent, ...]:
        """The connection events of the turn, each in its last known state, by start."""
        events = {event.id: event for outcome in self.outcomes for event in outcome.events}
        return tuple(sorted(events.values(), key=lambda each: each.started.seconds))

    @property
    def answer(self) -> TurnAnswer | None:
        """Answer to the turn; None: nothing so far, or it asked for nothing."""
        pairs = [each for each in self.events if each.kind == "adjacency_pair" and each.response]
        if not pairs:
            return None
        pair = pairs[-1]
        by = pair.answered_by or pair.responder
        texts = {(each.id, each.began): each.text for it in self.outcomes for each in it.heard if each.actor == by}
        assert pair.response
        return TurnAnswer(action=pair.response, by=by, delay=pair.delay or 0.0, text=" ".join(texts.values()))

    # -- its beginning and its end ------------------------------------------------------------------------------

    async def __aenter__(self) -> Self:
        self._body = asyncio.current_task()
        assert self._body is not None
        self._cancelled_before = self._body.cancelling()
        self._robot._requests.check()
        self._worlds = WorldFeed(self._robot._bus)
        self._objects = KnownObjects(self._worlds, self._robot.now)
        kinds = (TurnClosed, PeerAlive, PeerGone, WordSpoken, BlockProgress)
        self._told: Feed[TurnClosed | PeerAlive | PeerGone | WordSpoken | BlockProgress] = self._robot._feed(
            kinds, keys.TURN_CLOSED, keys.ANY_ROBOT_ALIVE, keys.SYNC_POINT, keys.FEEDBACK
        )
        self._watching = asyncio.create_task(self._watch(), name=f"turn {self.id}")
        await self._objects.ids(is_needed=False)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        body, self._body = self._body, None
        is_own = False
        if self._was_left and body is not None:
            is_own = body.uncancel() <= self._cancelled_before and kind is asyncio.CancelledError
        self._goes_on.set()
        self._unsettle()
        try:
            if kind is None and not self._is_broken:
                await self._finish()
            elif not is_own:
                await self.stop()
                self._hand_over_silently()
            await self._all_performed()
        finally:
            await self._close()
        return is_own

    async def _finish(self) -> None:
        chunk = self._chunker.rest(await self._objects.ids(is_needed=False))
        self._left_out += self._chunker.left_out
        # Where nobody has written anything there is no turn.
        if not self._is_finished and (self._fragments or chunk or self._left_out):
            self._send(chunk, "end", self._question)

    async def _all_performed(self) -> None:
        """Wait for all outcomes, and leave no turn open: a fragment that was refused may have been to end it."""
        try:
            await self.spoken()
            statuses = [each.status for each in self._done().values()]
            is_over = statuses[:1] == ["refused"] or {"interrupted", "unknown"} & {*statuses}
            if "refused" in statuses and not is_over:
                with suppress(EngageError):  # there was none
                    await self._robot.perform(self._fragment((), "end"))
        except asyncio.CancelledError:
            await self.stop()
            raise

    def _hand_over_silently(self) -> None:
        """End a turn that was stopped in a pause: no fragment was interrupted, so it is open."""
        statuses = [task.result().status for task in self._performing if task.done() and not task.cancelled()]
        sent = statuses[: len(self._sent)]
        if sent and {*sent} == {"done"} and self._fragments[len(self._sent) - 1].turn_status not in ("end", "full"):
            self._robot.begin_to_perform(self._fragment((), "end"))

    async def _close(self) -> None:
        for task in (self._watching, *self._performing):
            task.cancel()
        await asyncio.gather(self._watching, *self._performing, return_exceptions=True)
        while (told := await self._told.next(0.0)) is not None:
            if isinstance(told, WordSpoken):
                self._hear(told)
        self._told.close()
        self._worlds.close()
        self._left_out += self._chunker.left_out
        self._rest = self._chunker.rest()
        self._is_over = True
        self._news.set()

    _rest: Chunk = ()
    """What was written and never sent."""

    @cached_property
    def _outcomes(self) -> tuple[FragmentOutcome, ...]:
        """Outcomes of all that was sent, and of what never was."""
        lost = OutcomeUnknown(Fault(reason="generation is gone", where=self.id))
        outcomes = [
            outcome_of(lost, task.get_name()) if task.cancelled() else task.result() for task in self._performing
        ]
        if outcomes and self._was_left:
            rest = self._fragment((), "end").id
            if {each.status for each in outcomes} == {"done"}:
                outcomes.append(outcome_of(lost, rest))
                if (closed := self._closed) is not None:
                    cut = replace(
                        outcomes[-1], status="interrupted", events=closed.events, heard=closed.heard,
                        interjections=closed.interjections, fault=Fault(reason=closed.reason, where=self.id),
                    )  # fmt: skip
                    outcomes[-1] = self._robot._with_new_words(cut)
            outcomes[-1] = replace(outcomes[-1], unsaid=(*outcomes[-1].unsaid, rest))
        if outcomes and self._left_out:
            told = tuple(dict.fromkeys((*outcomes[-1].warnings, *self._left_out)))
            outcomes[-1] = replace(outcomes[-1], warnings=told)
        return tuple(outcomes)

    # -- fragments ----------------------------------------------------------------------------------------------

    def _whole(
        self,
        pieces: Iterable[Piece],
        status: TurnStatus,
        result: Callable[[FragmentOutcome], T],
        change: Change = _UNCHANGED,
    ) -> Sent[T]:
        """Send what was written before and these pieces, complete, as one fragment."""
        ids, parts = self._objects.known, []
        for piece in pieces:
            self._check(piece)
            parts += [part for chunk in self._chunker.feed(piece, ids) for part in chunk]
        self._check()
        self._unsettle()
        parts += self._chunker.rest(ids)
        doing = self._send(tuple(parts), status, change)
        return Sent(doing, lambda: result(self._outcome(doing)))

    def _outcome(self, task: "asyncio.Task[FragmentOutcome]") -> FragmentOutcome:
        lost = OutcomeUnknown(Fault(reason="the turn is over", where=self.id))
        return outcome_of(lost, task.get_name()) if task.cancelled() else task.result()

    def _check(self, piece: Any = "") -> None:
        if not isinstance(piece, Piece):
            raise InputRefused(unreadable(f"the piece {shown(piece)} is neither text nor a `Part`", self.id))
        if self._is_over or not hasattr(self, "_watching"):
            raise InputRefused(
                Fault(reason="the turn is not under way", where=self.id, advice="async with ... as turn")
            )
        if self._is_finished and not self._is_broken:
            advice = "what is asked is said last: begin another turn"
            raise InputRefused(Fault(reason="the turn has ended", where=self.id, advice=advice))

    def _unsettle(self) -> None:
        if self._settling is not None:
            self._settling.cancel()

    def _settle(self, ids: Ids) -> None:
        """Send what is finished, since no piece comes."""
        for chunk in self._chunker.settled(ids):
            self._send(chunk, "middle")

    def _send(self, chunk: Chunk, status: TurnStatus, change: Change = _UNCHANGED) -> "asyncio.Task[FragmentOutcome]":
        self._is_finished = status == "end"
        if not self._fragments:
            status = "full" if self._is_finished else "beginning"
        fragment = change(self._fragment(chunk, status))
        self._fragments.append(fragment)
        # Requests keep the order of these tasks: each stands in line in its task's first step.
        doing = asyncio.create_task(self._perform(fragment), name=fragment.id)
        self._performing.append(doing)
        return doing

    def _fragment(self, chunk: Chunk, status: TurnStatus) -> TurnFragment:
        id = f"{self.id}-{len(self._performing) + 1}"
        return fragment_of(chunk, replace(self._turn, turn_status=status), id)

    async def _perform(self, fragment: TurnFragment) -> FragmentOutcome:
        async with self._line:
            await self._goes_on.wait()
            if self._is_broken:
                return FragmentOutcome(id=fragment.id, fragment=fragment.id, status="refused", unsaid=fragment.worded)
            pending = self._robot._send(fragment)
            self._sent[fragment.id] = pending
            try:
                await pending.accepted
            except EngageError:
                self._is_broken = True
        try:
            outcome = await self._robot._end_of(pending, await_answer=self._is_awaited)
        except EngageError as error:
            outcome = outcome_of(error, fragment.id, fragment.worded)
        if outcome.status != "done":
            self._is_broken = True
            self._leave()
        return outcome

    def _done(self) -> dict[str, FragmentOutcome]:
        tasks = [task for task in self._performing if task.done() and not task.cancelled()]
        return {task.get_name(): task.result() for task in tasks}

    def _said_of(self, fragment: TurnFragment) -> tuple[str, ...]:
        if (outcome := self._done().get(fragment.id)) is not None and outcome.status != "unknown":
            return tuple(each.text for each in outcome.spoken)
        return (" ".join(self._live.get(fragment.id, ())),)

    async def _steer(self, order: Callable[[str], Awaitable[Any]]) -> None:
        for id, pending in list(self._sent.items()):
            if not pending.outcome.done():
                with suppress(InputRefused):  # its block has not begun, or has ended meanwhile
                    await order(id)

    # -- what is told of it -------------------------------------------------------------------------------------

    def _leave(self) -> None:
        """Leave the body of `async with` where it waits."""
        if self._body is not None and not self._was_left:
            self._was_left = True
            self._body.cancel()

    async def _watch(self) -> None:
        """Leave the body as soon as the turn is over, though no fragment is: somebody spoke while no piece came."""
        gone_until: Seconds | None = None
        while True:
            patience = None if gone_until is None else max(0.0, gone_until - self._robot.now())
            match await self._told.next(patience):
                case WordSpoken() as word:
                    self._hear(word)
                case BlockProgress(block=str(block), progress=progress) if block in self._sent:
                    (self._going.add if progress == "start" else self._going.discard)(block)
                    self._begins.set()
                case TurnClosed(status="aborted") as closed if closed.turn == f"{self.id}-1":
                    if self._body is not None:
                        self._closed, self._is_broken = closed, True
                        self._leave()
                case PeerGone(participant="generation"):
                    gone_until = self._robot.now() + Patience().grace
                case PeerAlive(participant="generation"):
                    gone_until = None
                case None:
                    if gone_until is None:
                        return  # the client has ended
                    gone_until = None
                    self._lose()

    def _hear(self, word: WordSpoken) -> None:
        if word.block in self._sent and word.word:
            self._words.append(word.word)
            self._live.setdefault(word.block, []).append(word.word)
            self._first.setdefault(word.block, self._robot.local(word.at))
            self._news.set()

    def _lose(self) -> None:
        """Send no more of a turn that has begun: another life of generation knows nothing of it."""
        accepted = {id for id, pending in self._sent.items() if pending.accepted.done()}
        if accepted:
            self._is_broken = True
            self._leave()
            for task in self._performing:
                if task.get_name() not in accepted:
                    task.cancel()
