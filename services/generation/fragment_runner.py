"""Runs fragments: takes them, sends their blocks in order, follows these, and answers with the outcomes.

While a fragment goes on, what its references were chosen for may move or leave. Then the choice is looked at again.
"""

import asyncio
from collections.abc import Callable, Collection, Iterable
from functools import reduce
from typing import Literal

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded
from engage_hri.schemas.behaviors import GazeShift, TurnSignal
from engage_hri.schemas.blocks import BlockOutcome, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import AbortBehavior, WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.feedback import SyncPointProgress, WarningFeedback
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, is_asked_to_stop
from engage_hri.services.generation.body_link import BodyLink
from engage_hri.services.generation.choosing_again import (
    barred,
    changed,
    first_that_differs,
    named_objects,
    open_references,
    remembered,
    with_other_words,
    without,
)
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.fragment_check import check_world, performable
from engage_hri.services.generation.head.arbiter import Arbiter
from engage_hri.services.generation.head.inhibitions import Leases
from engage_hri.services.generation.lost import bearable
from engage_hri.services.generation.performance import Ended, FragmentPerformance, GazesOfFragments
from engage_hri.services.generation.permits import Permits
from engage_hri.services.generation.pipeline import glance, planning, targets
from engage_hri.services.generation.references.discourse import NO_DISCOURSE, Discourse
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.events import TurnEvents, TurnOutcomes
from engage_hri.services.generation.turns.heard import HeardWords
from engage_hri.services.generation.turns.policy import Aborted, TurnPlan, TurnPolicy
from engage_hri.services.requests.deadlines import Silences
from engage_hri.services.requests.ends import Pending, RequestDesk, Requester, RequestRefused
from engage_hri.services.requests.serving import GRACE

FRAGMENTS = 200
"""Number of fragments that may be waiting or performed at once; one more is refused, so that a task that never waits
is told so. Ours."""
_RECOGNITION_AWAY = ("away", "recognition")


class FragmentRunner:
    """All fragments that wait or are performed. `deadline`: when to call `settle` at the latest."""

    def __init__(
        self,
        bus: Bus,
        config: GenerationConfig,
        desk: RequestDesk,
        requests: Requester,
        arbiter: Arbiter,
        leases: Leases,
        changed: Callable[[Seconds], None],
    ) -> None:
        """changed: called with the time when a fragment has made progress outside `feed` and `settle`."""
        self._bus = bus
        self._config = config
        self._desk = desk
        self._requests = requests
        self._arbiter = arbiter
        self._leases = leases
        self._changed = changed
        self._turns = TurnPolicy(bus.robot, config, bus.sight)
        self._events = TurnEvents()
        self._heard = HeardWords()
        self._outcomes = TurnOutcomes(self._events, self._heard, config, bus.sight)
        self._gazes = GazesOfFragments()
        self._body = BodyLink(bus)
        self._world: World | None = None
        self._discourse = NO_DISCOURSE
        self._live: dict[str, FragmentPerformance] = {}
        """Fragments by request id, from `admit` until their outcome is sent."""
        self._line: asyncio.Queue[FragmentPerformance] = asyncio.Queue()
        self._blocks: dict[asyncio.Task[None], str] = {}
        """Tasks that wait for the end of a fragment's block, and the turn of each."""
        self._news = asyncio.Event()
        """Set when something has changed, in the world or of a fragment."""
        self._session = f"{bus.name}@{bus.now():.6f}"
        """Part of each request id, so that the ids differ after a restart."""
        self._signals = 0
        self._waits = Silences[tuple[str, str]](bus.sight)
        """Times until which recognition may be away, and until which it is to decide the events of a request."""

    # -- what arrives ---------------------------------------------------------------------------------------------

    def full(self, waiting: int, id: str) -> Fault | None:
        """A fault if fragment `id` is one too many; else None. waiting: those that wait to be admitted."""
        if (number := len(self._live) + waiting) < FRAGMENTS:
            return None
        reason = f"{number} fragments are waiting or performed, which is the limit"
        return Fault(reason=reason, where=id, advice="wait until one has ended")

    def admit(self, request: PerformFragment, world: World) -> None:
        """Queue a fragment. Raises InputRefused where it is illegal, and changes nothing that goes on."""
        fragment, lost = performable(request.fragment, world, self._bus.robot)
        self._abort(self._turns.begins_again(request.requester, request.life), self._bus.now())
        turn = self._turns.accept(fragment, fragment.addressee, request.requester, request.life)
        performance = FragmentPerformance(request, fragment, turn, self._config.decision_patience)
        performance.warn(lost)
        performance.known = named_objects(fragment, world)
        if (displaced := self._outcomes.expect(fragment.id, turn)) is not None:
            self._bus.publish(keys.TURN_CLOSED, displaced)
        self._events.expect(fragment.id, turn.turn)
        self._heard.turn_begins(turn.turn, self._bus.now())
        if any(not each.is_over and each.turn.turn != turn.turn for each in self._live.values()):
            self._accept(performance)
        # A fragment that need not wait for another turn is accepted when its block is: then, if the realizer finds
        # the block impossible, the fragment is refused, too.
        self._live[request.id] = performance
        self._line.put_nowait(performance)

    def refused(self, request: PerformFragment, why: Fault, now: Seconds) -> None:
        """Draw the consequences, for its turn, of a fragment that was refused before it could be admitted."""
        self._abort(self._turns.rest_refused(request.fragment, request.requester, why), now)

    def _accept(self, performance: FragmentPerformance) -> None:
        if not performance.accepted:
            performance.accepted = True
            self._desk.accept(performance.request.id)

    def cancel(self, id: str, why: Fault, now: Seconds) -> None:
        """Cancel the fragment of request `id`, if it is here, and with it the rest of its turn."""
        if (performance := self._live.get(id)) is None:
            return
        aborted = self._turns.fragment_ended(performance.fragment.id, complete=False, now=now, why=why)
        self._interrupt({performance.fragment.id, *(aborted.fragments if aborted else ())}, why, now)
        self._abort(aborted, now)

    def feed(
        self,
        message: World | ConnectionEvent | ActionBegan | ActionEnded | SyncPointProgress | WordSpoken | Utterance,
        now: Seconds,
    ) -> None:
        match message:
            case World():
                self._world = message
                self._turns.see([person.id for person in message.people], now)
            case ConnectionEvent():
                self._events.feed(message, now)
                self._discourse = self._discourse.hearing(message, self._bus.robot)
            case ActionBegan() | ActionEnded():
                self._turns.feed(message, now)
            case SyncPointProgress():
                self._follow(message)
            case WordSpoken(block=block):
                for performance in self._live.values():
                    if performance.fragment.id == block and not performance.is_over:
                        performance.hear(message)
            case Utterance():
                self._heard.feed(message, now)
                self._turns.hear(
                    message.actor, message.text, began=self._bus.local(message.began), is_final=message.final,
                    is_line=message.began == message.at,
                )  # fmt: skip

    def recognition_gone(self, now: Seconds) -> None:
        """Start the grace after which the open events are lost: recognition may only be cut off."""
        self._waits.set(_RECOGNITION_AWAY, now + GRACE)

    def recognition_there(self, session: str) -> None:
        self._waits.clear(_RECOGNITION_AWAY)
        self._events.lose(session)

    def body_lost(self) -> None:
        """Forget the body: another one may come."""
        self._body.forget()

    def _follow(self, progress: SyncPointProgress) -> None:
        """Pass a sync point to its fragment, and tell the arbiter of its gazes when they really happen."""
        named = [each for each in self._live.values() if each.fragment.id == progress.block]
        if not named:
            return
        # A fragment that has ended is second choice, but it still hears of its events.
        performance = min(named, key=lambda each: each.is_over)
        performance.feed(progress)
        self._news.set()
        if performance.signalled_end:
            self._turns.turn_ended(performance.turn.turn)
        self._follow_gaze(performance)

    def _follow_gaze(self, performance: FragmentPerformance) -> None:
        before = self._gazes.holder
        self._gazes.follow(performance)
        gaze = self._gazes.holder
        if not self._gazes.goes_on:
            self._arbiter.fragment_lets_go()
        elif gaze is None and before is not None:
            self._arbiter.fragment_rests()
        elif isinstance(gaze, GazeShift) and gaze is not before:
            self._arbiter.fragment_shifts(gaze.target, gaze.id)
        elif gaze is not None and gaze is not before:
            self._arbiter.fragment_gazes(gaze.target, gaze.id)

    # -- time -----------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        due = (self._turns.deadline, self._outcomes.deadline, self._waits.earliest)
        return min((each for each in due if each is not None), default=None)

    def settle(self, now: Seconds) -> list[tuple[str, Fault]]:
        """End turns and fragments that are over by now. Returns the requests to refuse, each with the reason."""
        refused: list[tuple[str, Fault]] = []
        self._news.set()
        for id, performance in self._live.items():
            self._waits.keep(("undecided", id), performance.deadline, now)
        due = {*iter(lambda: self._waits.due(now), None)}
        if _RECOGNITION_AWAY in due:
            self._events.lose()
        while (aborted := self._turns.tick(now)) is not None:
            self._abort(aborted, now)
        permits = self._leases.permits()
        for performance in list(self._live.values()):
            self._enforce_inhibitions(performance, permits)
            if performance.refusal is not None:
                self._forget(performance)
                self._outcomes.refuse(performance.fragment.id, performance.turn)
                refused.append((performance.request.id, performance.refusal))
            elif outcome := performance.outcome(self._events, is_due=("undecided", performance.request.id) in due):
                self._forget(performance)
                self._outcomes.end(outcome, performance.turn, now)
                self._desk.end(replace(outcome, heard=self._heard.of_turn(performance.turn.turn)))
                if not performance.turn.backchannel:  # that is said in the other's turn
                    self._heard.turn_ends(now)
        going = {each.turn.turn for each in self._live.values()} | {self._turns.open_turn}
        for closed in self._outcomes.close_due(going, now):
            self._bus.publish(keys.TURN_CLOSED, closed)
        self._events.forget({*going, *self._outcomes.turns})
        self._heard.forget({*going, *self._outcomes.turns})
        return refused

    def _forget(self, performance: FragmentPerformance) -> None:
        del self._live[performance.request.id]
        self._waits.clear(("undecided", performance.request.id))

    def _enforce_inhibitions(self, performance: FragmentPerformance, permits: Permits) -> None:
        block = performance.fragment.id
        for behavior in performance.forbid(permits):
            how: Literal["freeze", "relax"] = "freeze" if self._leases.holds_head else "relax"
            id = f"{performance.block_id}/{behavior}:abort"
            self._requests.send(keys.BEHAVIOR, AbortBehavior(id=id, block=block, behavior=behavior, how=how))

    # -- fragments: those of a turn at once, turns one after the other --------------------------------------------

    async def perform_in_order(self) -> None:
        """Send each fragment's block as soon as the blocks of other turns have ended.

        The blocks of one turn are sent at once: each names the points of the others that it follows.
        """
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._keep_choices(), name="choices")
            while True:
                performance = await self._line.get()
                turn = performance.turn.turn
                if before := [block for block, its in self._blocks.items() if its != turn]:
                    await asyncio.wait(before)
                await self._all_made(turn)
                if not performance.is_over and (pending := await self._begin(performance)) is not None:
                    block = tasks.create_task(self._await_end(performance, pending), name=performance.block_id)
                    self._blocks[block] = turn
                    block.add_done_callback(self._blocks.pop)
                with self._bus.containing(f"what follows the beginning of fragment {performance.fragment.id}"):
                    self._changed(self._bus.now())

    async def _begin(self, performance: FragmentPerformance) -> Pending | None:
        """Plan and send a block of a fragment. Returns its accepted request; None if the fragment has ended."""
        fragment, turn = performance.left, performance.turn_left
        self._arbiter.stop_thinking()
        self._arbiter.speak_to(turn.addressee)
        permits = self._leases.permits
        try:
            while True:
                followed = [each for each in self._live.values() if each.goes_on_with(performance)]
                moving = [behavior for each in followed for behavior in each.moving]
                glanced = glance(fragment, turn, self._config)
                motions = await self._body.motions(targets(fragment), permits().only_hand, moving, glanced)
                if performance.is_over:  # cancelled meanwhile
                    return None
                assert self._world is not None
                world = remembered(self._world, performance.known)
                fragment, lost = bearable(fragment, world, self._bus.robot)
                performance.warn(lost)
                check_world(fragment, world, self._bus.robot)  # it may have changed while the fragment waited
                bars = barred(targets(fragment), self._world, performance.known, performance.barred)
                body = self._body.capabilities
                if body is not None:
                    self._arbiter.gaze_perceived_within(body.gaze_half_angle)
                before = reduce(Continuation.then, (each.continuation for each in followed), NO_CONTINUATION)
                heard, permitted, config = self._heard_in(turn), permits(), self._config
                reachable = without(motions, bars)
                try:
                    made = await self._body.planned(
                        planning(fragment, turn, world, body, reachable, permitted, config, before, heard)
                    )
                except Unreferable:
                    if (freed := with_other_words(fragment, bars)) is None:
                        raise
                    fragment = performance.left = freed  # the author has no phrase that is enough without a gesture
                    continue
                if performance.is_over:  # cancelled meanwhile
                    return None
                if permits() != permitted:
                    continue  # what was inhibited meanwhile is not begun
                performance.begin(made)
                performance.world = world
                pending = await self._send_block(performance, followed)
                named = [mention.object for mention in made.mentions]
                self._discourse = self._heard_in(turn).naming(fragment.id, named)
                performance.is_sent = True
                self._news.set()
                return pending
        except RequestRefused as error:
            performance.refuse(error.fault, self._bus.now())
        except EngageError as error:
            performance.fail(error, self._bus.now())
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop():
                raise
            fault = self._bus.failed(error, f"fragment {fragment.id}")
            performance.fail(RunFailed(fault), self._bus.now())
        self._block_ended(performance)
        return None

    def _heard_in(self, turn: TurnPlan) -> Discourse:
        """The discourse at the start of `turn`. A backchannel is said in the other's turn, and changes nothing."""
        return self._discourse if turn.backchannel else self._discourse.in_turn(turn.turn, turn.addressee)

    async def _send_block(self, performance: FragmentPerformance, followed: Iterable[FragmentPerformance]) -> Pending:
        """Send the block and wait until it is accepted. followed: fragments without which it fails, too."""
        assert performance.plan is not None
        request = PerformBlock(
            id=performance.block_id,
            block=performance.plan.block,
            follows=tuple([each.fragment.id for each in followed]),
        )
        self._turns.fragment_begins(performance.turn.turn)
        if not performance.accepted:  # From here on the robot may speak.
            self._desk.hear(performance.request.id)
        pending = self._requests.send(keys.BLOCK, request)
        await pending.accepted
        self._accept(performance)
        for message in performance.new_warnings():
            warning = WarningFeedback(block=performance.fragment.id, kind="POLICY", message=message)
            self._bus.publish(keys.FRAGMENT_FEEDBACK, warning)
        return pending

    async def _await_end(self, performance: FragmentPerformance, pending: Pending) -> None:
        """Wait for the end of a fragment: of its block, and of those with which it goes on after a new choice."""
        try:
            outcome = await pending.outcome
            while True:
                if not isinstance(outcome, BlockOutcome):
                    reason = f"the realizer answered {type(outcome).__name__}"
                    raise RunFailed(Fault(reason=reason, where=performance.block_id))
                performance.end_with(outcome, self._bus.now())
                if performance.is_over:
                    break
                self._follow_gaze(performance)
                self._discourse = self._discourse.without(performance.fragment.id, performance.unmentioned)
                if (following := await self._begin(performance)) is None:
                    return
                outcome = await following.outcome
        except EngageError as error:
            performance.fail(error, self._bus.now())
        with self._bus.containing(f"the end of fragment {performance.fragment.id}"):
            self._block_ended(performance)
            self._changed(self._bus.now())

    # -- references, chosen again while their fragments go on -----------------------------------------------------

    async def _all_made(self, turn: str) -> None:
        """Wait until no reference of the turn's fragments under way is chosen again: words follow on words."""
        while any(each.acts and each.may_choose_again for each in self._live.values() if each.turn.turn == turn):
            await self._changes()

    async def _keep_choices(self) -> None:
        """Choose again where objects have moved or left since the choice, until cancelled."""
        while True:
            for performance in list(self._live.values()):
                if self._has_changed(performance):
                    with self._bus.containing(f"another choice for fragment {performance.fragment.id}"):
                        await self._choose_again(performance)
            await self._changes()

    async def _changes(self) -> None:
        if self._news.is_set():
            self._news = asyncio.Event()
        await self._news.wait()

    def _has_changed(self, performance: FragmentPerformance) -> bool:
        then, now = performance.world, self._world
        is_going_on = performance.plan is not None and performance.is_sent and not performance.is_over
        return is_going_on and then is not None and now is not None and changed(performance.acts[-1], then, now)

    async def _choose_again(self, performance: FragmentPerformance) -> None:
        """Take out the gestures of the first reference that would be made otherwise in the world as it is now.

        What needs them falls, and the rest of the fragment is performed by another block.
        """
        act, turn, now = performance.acts[-1], performance.turn_left, self._world
        assert now is not None
        performance.world = world = remembered(now, performance.known)
        fragment = open_references(performance.left, act)
        bars = barred(targets(fragment), now, performance.known, performance.barred)
        permits, body = self._leases.permits(), self._body
        try:
            motions = without(await body.motions(targets(fragment), permits.only_hand), bars)
            made = await body.planned(
                planning(fragment, turn, world, body.capabilities, motions, permits, self._config)
            )
            choices = made.choices
        except Unreferable:
            choices = ()
        except EngageError:
            return  # the body does not answer: the realizer will tell
        if performance.is_over or performance.plan is None or performance.acts[-1] is not act:
            return
        for gesture in first_that_differs(act, choices, bars):
            id = f"{performance.block_id}/{gesture}:again"
            self._requests.send(keys.BLOCK, InterruptBehavior(id=id, block=performance.fragment.id, behavior=gesture))

    # -- ends -----------------------------------------------------------------------------------------------------

    def _block_ended(self, performance: FragmentPerformance) -> None:
        """Draw the consequences of a block that has ended, or that will never be, for turn, head and discourse."""
        now, fragment = self._bus.now(), performance.fragment
        self._follow_gaze(performance)
        self._discourse = self._discourse.without(fragment.id, performance.unmentioned)
        if performance.refusal is not None:
            aborted = self._turns.fragment_refused(fragment.id, now, performance.refusal)
        else:
            complete = performance.status == "done" or performance.lost_motions_only
            aborted = self._turns.fragment_ended(fragment.id, complete=complete, now=now, why=performance.why)
        self._abort(aborted, now)
        if target := self._turns.averted_to:
            self._arbiter.think(target)

    def _interrupt(self, fragments: Collection[str], why: Fault, now: Seconds) -> None:
        """End these fragments, the latest first: a block that follows another's words must not begin as those end."""
        for performance in reversed(self._live.values()):
            if performance.is_over or performance.fragment.id not in fragments:
                continue
            if performance.plan is not None:
                self._requests.cancel(performance.block_id, why)
            else:
                performance.end(Ended(now, "interrupted", fault=why.at(performance.fragment.id)))

    def _abort(self, aborted: Aborted | None, now: Seconds) -> None:
        """End the fragments of a turn that has ended early, and tell recognition of it. None: no turn has."""
        if aborted is None:
            return
        self._arbiter.stop_thinking()
        self._outcomes.abort(aborted, now)
        self._interrupt(aborted.fragments, aborted.why, now)
        if not aborted.is_known:
            return
        self._signals += 1
        id = f"turn-aborted-{self._signals}"
        signal = TurnSignal(id=id, turn=aborted.turn, signal="aborted", actor=aborted.addressee)
        request = SignalTurn(id=f"{self._session}/{id}", signal=signal, at=self._bus.stamp(now))
        self._requests.send(keys.TURN, request)
