"""Fragments that wait or are performed: taken, their blocks sent in order and followed, answered with outcomes. Pure.

The blocks of one turn are sent at once: each names the points of the others that it follows. Turns come one after the
other. While a fragment goes on, what its references were chosen for may move or leave. Then the choice is looked at
again.
"""

from collections.abc import Callable, Collection, Generator, Mapping
from functools import reduce
from typing import Any, Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import GazeShift, Speech, TurnSignal
from engage_hri.schemas.blocks import (
    BlockOutcome,
    InterruptBehavior,
    PerformBlock,
    SteerPerformance,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import AbortBehavior, WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, RequestRefused, RunFailed, bug
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Interjection, SignalTurn
from engage_hri.schemas.requests import Accepted, Heard, Refused
from engage_hri.schemas.text import word_count
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.acts import (
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
from engage_hri.services.generation.exchange import NAME, CancelRequest, NoAnswer, SendRequest, Way, Ways
from engage_hri.services.generation.followed import Followed
from engage_hri.services.generation.fragment_check import bearable, check_world, performable
from engage_hri.services.generation.head.arbiter import Arbiter
from engage_hri.services.generation.inhibitions import Leases, Permits
from engage_hri.services.generation.performance import Ended, FragmentPerformance, GazesOfFragments
from engage_hri.services.generation.pipeline import BodyLink, glance, planning, targets
from engage_hri.services.generation.references.phrases import NO_DISCOURSE, Discourse
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.outcomes import HeardWords, TurnEvents, TurnOutcomes
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.generation.turns.policy import TurnPolicy
from engage_hri.services.generation.turns.robot_turns import Aborted, RobotTurns
from engage_hri.services.requests.serving import GRACE
from engage_hri.services.runtime.intake import AnswerRequest, MachineClocks, PublishMessage, TellMistake

FRAGMENTS = 200
"""Number of fragments that may be waiting or performed at once; one more is refused, so that a task that never waits
is told so. Ours."""
LAST_WORDS = 2
"""Number of words, the one being said among them, that end a turn in any case: people begin to answer over them."""
_RECOGNITION_AWAY = ("away", "recognition")


class Fragments:
    """All fragments that wait or are performed.

    deadline: when to call `settle` at the latest.
    """

    def __init__(
        self,
        robot: str,
        config: GenerationConfig,
        clock: MachineClocks,
        session: str,
        sight: Sight,
        arbiter: Arbiter,
        leases: Leases,
        tell: Callable[[Struct], None],
        policies: Mapping[str, type[TurnPolicy]],
    ) -> None:
        """session: part of each request id, so that the ids differ after a restart. tell: called with each output.

        policies: of turns, of installed packages.
        """
        self._robot = robot
        self._config = config
        self._clock = clock
        self._session = session
        self._arbiter = arbiter
        self._leases = leases
        self._tell = tell
        self._now: Seconds = 0.0
        """Time of this step."""
        self._turns = RobotTurns(robot, config, policies, sight)
        self._events = TurnEvents()
        self._heard = HeardWords()
        self._outcomes = TurnOutcomes(self._events, self._heard, self._turns.interjections, config, sight)
        self._gazes = GazesOfFragments()
        self._body = BodyLink()
        self._ways = Ways(tell)
        self._world: World | None = None
        self._discourse = NO_DISCOURSE
        self._live: dict[str, FragmentPerformance] = {}
        """Fragments by request id, in the order in which they came, from `admit` until their outcome is told."""
        self._is_choosing = False
        """True while a choice is looked at again."""
        self._signals = self._holds = 0
        self._waits = Silences[tuple[str, str]](sight)
        """Times until which recognition may be away, and until which it is to decide the events of a request."""

    @property
    def policies(self) -> Followed[TurnPolicy]:
        return self._turns.policies

    @property
    def holds_the_turn(self) -> bool:
        """True while a turn of the robot goes on, or is to begin."""
        return self._turns.holds_the_turn

    # -- what arrives ---------------------------------------------------------------------------------------------

    def full(self, waiting: int, id: str) -> Fault | None:
        """A fault if fragment `id` is one too many; else None. waiting: those that wait to be admitted."""
        if (number := len(self._live) + waiting) < FRAGMENTS:
            return None
        reason = f"{number} fragments are waiting or performed, which is the limit"
        return Fault(reason=reason, where=id, advice="wait until one has ended")

    def admit(self, request: PerformFragment, world: World, now: Seconds) -> None:
        """Queue a fragment. Raises InputRefused where it is illegal, and changes nothing that goes on."""
        fragment, lost = performable(request.fragment, world, self._robot)
        self._abort(self._turns.begins_again(request.requester, request.life), now)
        turn = self._turns.accept(fragment, fragment.addressee, request.requester, request.life)
        performance = FragmentPerformance(request, fragment, turn, self._config.decision_patience)
        performance.warn(lost)
        performance.known = named_objects(fragment, world)
        if (displaced := self._outcomes.expect(fragment.id, turn)) is not None:
            self._tell(PublishMessage(keys.TURN_CLOSED, displaced))
        self._events.expect(fragment.id, turn.turn)
        self._heard.turn_begins(turn.turn, now)
        if any(not each.is_over and each.turn.turn != turn.turn for each in self._live.values()):
            self._accept(performance)
        # A fragment that need not wait for another turn is accepted when its block is: then, if the realizer finds
        # the block impossible, the fragment is refused, too.
        self._live[request.id] = performance

    def refused(self, request: PerformFragment, why: Fault, now: Seconds) -> None:
        """Draw the consequences, for its turn, of a fragment that was refused before it could be admitted."""
        self._abort(self._turns.rest_refused(request.fragment, request.requester, why), now)

    def _accept(self, performance: FragmentPerformance) -> None:
        if not performance.accepted:
            performance.accepted = True
            self._tell(AnswerRequest(Accepted(id=performance.request.id)))

    def cancel(self, id: str, why: Fault, now: Seconds) -> None:
        """Cancel the fragment of request `id`, if it is here, and with it the rest of its turn."""
        if (performance := self._live.get(id)) is None:
            return
        aborted = self._turns.fragment_ended(performance.fragment.id, complete=False, now=now, why=why)
        self._interrupt({performance.fragment.id, *(aborted.fragments if aborted else ())}, why, now)
        self._abort(aborted, now)

    def feed(
        self,
        message: World | ConnectionEvent | Interjection | ActionEnded | SyncPointProgress | WordSpoken | Utterance,
        now: Seconds,
    ) -> None:
        match message:
            case World():
                self._world = message
                self._turns.feed(message, now)
            case ConnectionEvent():
                self._events.feed(message, now)
                self._discourse = self._discourse.hearing(message, self._robot)
            case Interjection() | ActionEnded():
                self._turns.feed(message, now)
            case SyncPointProgress():
                self._follow(message, now)
            case WordSpoken(block=block):
                for performance in self._live.values():
                    if performance.fragment.id == block and not performance.is_over:
                        performance.hear(message)
            case Utterance() if message.actor != self._robot:
                self._heard.feed(message, now)
                self._turns.feed(message, now)

    def rename(self, name: Callable[[str], str]) -> None:
        """Speak to people by other ids from now on. name: the new one of each."""
        self._turns.rename(name)
        self._outcomes.rename(name)
        self._heard.rename(name)
        for performance in self._live.values():
            performance.rename(name)

    def recognition_gone(self, now: Seconds) -> None:
        """Start the grace after which the open events are lost: recognition may only be cut off."""
        self._waits.set(_RECOGNITION_AWAY, now + GRACE)
        self._turns.interjections.recognition_gone()

    def recognition_there(self, session: str, now: Seconds) -> None:
        self._waits.clear(_RECOGNITION_AWAY)
        self._events.lose(now, session)

    def body_lost(self) -> None:
        """Forget the body: another one may come."""
        self._body.forget()

    def _follow(self, progress: SyncPointProgress, now: Seconds) -> None:
        """Pass a sync point to its fragment, and tell the arbiter of its gazes when they really happen."""
        named = [each for each in self._live.values() if each.fragment.id == progress.block]
        if not named:
            return
        # A fragment that has ended is second choice, but it still hears of its events.
        performance = min(named, key=lambda each: each.is_over)
        performance.feed(progress, self._events.session)
        if performance.signalled_end:
            self._turns.turn_ended(performance.turn.turn, now)
            if not self._turns.holds_the_turn:
                self._arbiter.wait_for_answers()
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

    def settle(self, now: Seconds) -> None:
        """End turns and fragments that are over by now."""
        for id, performance in self._live.items():
            self._waits.keep(("undecided", id), performance.deadline, now)
        due = {*iter(lambda: self._waits.due(now), None)}
        if _RECOGNITION_AWAY in due:
            self._events.lose(now)
        while (aborted := self._turns.tick(now)) is not None:
            self._abort(aborted, now)
        self._hold_or_go_on()
        permits = self._leases.permits()
        for performance in list(self._live.values()):
            self._enforce_inhibitions(performance, permits)
            if performance.refusal is not None:
                self._forget(performance)
                self._outcomes.refuse(performance.fragment.id, performance.turn)
                self._tell(AnswerRequest(Refused(id=performance.request.id, fault=performance.refusal)))
                self._tell(PublishMessage(keys.fault(NAME), performance.refusal))
            elif outcome := performance.outcome(self._events, is_due=("undecided", performance.request.id) in due):
                self._forget(performance)
                self._outcomes.end(outcome, performance.turn, now)
                turn = performance.turn.turn
                interjections = self._turns.interjections.of_turn(turn)
                told = replace(outcome, heard=self._heard.of_turn(turn), interjections=interjections)
                self._tell(AnswerRequest(told))
                if not performance.turn.backchannel:  # that is said in the other's turn
                    self._heard.turn_ends(now)
        going = {each.turn.turn for each in self._live.values()} | {self._turns.open_turn}
        for closed in self._outcomes.close_due(going, now):
            self._tell(PublishMessage(keys.TURN_CLOSED, closed))
        self._events.forget({*going, *self._outcomes.turns})
        self._heard.forget({*going, *self._outcomes.turns})
        self._turns.interjections.forget({*going, *self._outcomes.turns})

    def _forget(self, performance: FragmentPerformance) -> None:
        del self._live[performance.request.id]
        self._waits.clear(("undecided", performance.request.id))

    def _hold_or_go_on(self) -> None:
        """Hold what the robot says and does while it is undecided whether somebody interrupts it.

        It waits at the next gap between two words. Then it goes on from there, or the turn has ended.
        """
        held = self._turns.held
        for performance in self._live.values():
            is_going_on = performance.is_sent and self._turns.goes_on(performance.fragment.id)
            is_held = performance.turn.turn == held
            if is_held and not performance.is_held and performance.turn.closes:
                is_held = performance.words_left > LAST_WORDS
            if is_going_on and is_held != performance.is_held:
                performance.is_held = is_held
                self._holds += 1
                id = f"{performance.block_id}/hold-{self._holds}"
                to: Literal["hold", "continue"] = "hold" if is_held else "continue"
                steer = SteerPerformance(id=id, to=to, block=performance.fragment.id, own=True)
                self._tell(SendRequest(keys.BLOCK, steer))

    def _enforce_inhibitions(self, performance: FragmentPerformance, permits: Permits) -> None:
        block = performance.fragment.id
        for behavior in performance.forbid(permits):
            how: Literal["freeze", "relax"] = "freeze" if self._leases.holds_head else "relax"
            id = f"{performance.block_id}/{behavior}:abort"
            abort = AbortBehavior(id=id, block=block, behavior=behavior, how=how)
            self._tell(SendRequest(keys.BEHAVIOR, abort))

    # -- fragments: those of a turn at once, turns one after the other --------------------------------------------

    def answer(self, id: str, answer: Message | NoAnswer | None, now: Seconds) -> None:
        """Take news of a block, or the body's answer: the way that waits for it goes on."""
        self._now = now
        self._ways.answer(id, answer)

    def begin(self, now: Seconds) -> bool:
        """Begin what may begin now: the next fragment, another look at choices. False: there is nothing."""
        self._now = now
        if (following := self._next()) is not None:
            following.has_begun = True
            self._ways.begin(self._perform(following))
            if not targets(following.fragment):
                self._ways.begin(self._meet_body())
            return True
        if self._is_choosing or (changed := next(filter(self._has_changed, self._live.values()), None)) is None:
            return False
        self._is_choosing = True
        self._ways.begin(self._choose_again(changed))
        return True

    def _meet_body(self) -> Way:
        """Get to know a body that no reference asks: policies of the head have to know what it can."""
        if (body := (yield from self._body.described())) is not None:
            self._arbiter.has_body(body)

    def _next(self) -> FragmentPerformance | None:
        """The first fragment in line, if its block may be sent now.

        It may once the blocks of other turns have ended, and those of its own turn were accepted with words that will
        not change any more: words follow on words.
        """
        going = [each for each in self._live.values() if not each.is_over]
        first = next((each for each in going if not each.has_begun), None)
        if first is not None and all(
            each.turn.turn == first.turn.turn and each.is_sent and not each.may_choose_again
            for each in going
            if each.has_begun
        ):
            return first
        return None

    def _perform(self, performance: FragmentPerformance) -> Way:
        """All of a fragment: its block and, where a reference is chosen again, those with which it goes on."""
        try:
            while not performance.is_over:
                if not (yield from self._send_block(performance)):
                    return  # cancelled meanwhile
                outcome = yield performance.block_id
                if not isinstance(outcome, BlockOutcome):
                    reason = f"the realizer answered {type(outcome).__name__}"
                    raise RunFailed(Fault(reason=reason, where=performance.block_id))
                performance.end_with(outcome, self._now)
                self._follow_end(performance)
        except RequestRefused as error:
            performance.refuse(error.fault, self._now)
        except EngageError as error:
            performance.fail(error, self._now)
        except Exception as error:
            what = f"fragment {performance.fragment.id}"
            self._tell(TellMistake(error, what))
            performance.fail(RunFailed(bug(error, what, NAME)), self._now)
        self._block_ended(performance)

    def _send_block(self, performance: FragmentPerformance) -> Generator[Any, Any, bool]:
        """Plan and send a block of a fragment, until it is accepted. False: the fragment was cancelled meanwhile."""
        fragment, turn = performance.left, performance.turn_left
        self._arbiter.stop_thinking()
        self._arbiter.speak_to(turn.addressee)
        permits = self._leases.permits
        while True:
            followed = [each for each in self._live.values() if each.goes_on_with(performance)]
            moving = [behavior for each in followed for behavior in each.moving]
            glanced = glance(fragment, turn, self._config)
            motions = yield from self._body.motions(targets(fragment), permits().only_hand, moving, glanced)
            if performance.is_over:
                return False
            seen = self._world
            assert seen is not None
            world = remembered(seen, performance.known)
            fragment, lost = bearable(fragment, world, self._robot)
            performance.warn(lost)
            check_world(fragment, world, self._robot)  # it may have changed while the fragment waited
            bars = barred(targets(fragment), seen, performance.known, performance.barred)
            if (body := self._body.capabilities) is not None:
                self._arbiter.has_body(body)
            rests = NO_CONTINUATION if followed else self._arbiter.rest(self._now)
            before = reduce(Continuation.then, (each.continuation for each in followed), rests)
            heard, permitted, config = self._heard_in(turn), permits(), self._config
            reachable = without(motions, bars)
            try:
                made = yield from planning(fragment, turn, world, body, reachable, permitted, config, before, heard)
            except Unreferable:
                if (freed := with_other_words(fragment, bars)) is None:
                    raise
                fragment = performance.left = freed  # the author has no phrase that is enough without a gesture
                continue
            if performance.is_over:
                return False
            if permits() == permitted:
                break  # else something is inhibited now that would be begun
        performance.begin(made)
        performance.world = seen
        self._turns.fragment_begins(turn.turn)
        self._arbiter.says(sum(word_count(each.text) for each in made.block.behaviors if isinstance(each, Speech)))
        if not performance.accepted:  # From here on the robot may speak.
            self._tell(AnswerRequest(Heard(id=performance.request.id)))
        follows = tuple([each.fragment.id for each in followed])
        request = PerformBlock(id=performance.block_id, block=made.block, follows=follows)
        self._tell(SendRequest(keys.BLOCK, request))
        yield performance.block_id
        self._accept(performance)
        for message in performance.new_warnings():
            warning = WarningFeedback(block=performance.fragment.id, kind="POLICY", message=message)
            self._tell(PublishMessage(keys.FRAGMENT_FEEDBACK, warning))
        self._discourse = self._heard_in(turn).naming(fragment.id, [each.object for each in made.made])
        performance.is_sent = True
        return True

    def _heard_in(self, turn: TurnPlan) -> Discourse:
        """The discourse at the start of `turn`. A backchannel is said in the other's turn, and changes nothing."""
        return self._discourse if turn.backchannel else self._discourse.in_turn(turn.turn, turn.addressees)

    # -- references, chosen again while their fragments go on -----------------------------------------------------

    def _has_changed(self, performance: FragmentPerformance) -> bool:
        then, now = performance.world, self._world
        is_going_on = performance.plan is not None and performance.is_sent and not performance.is_over
        return is_going_on and then is not None and now is not None and changed(performance.acts[-1], then, now)

    def _choose_again(self, performance: FragmentPerformance) -> Way:
        """Take out the gestures of the first reference that would be made otherwise in the world as it is now.

        What needs them falls, and the rest of the fragment is performed by another block.
        """
        try:
            act, turn, now = performance.acts[-1], performance.turn_left, self._world
            assert now is not None
            performance.world, world = now, remembered(now, performance.known)
            fragment = open_references(performance.left, act)
            bars = barred(targets(fragment), now, performance.known, performance.barred)
            permits, body = self._leases.permits(), self._body
            try:
                motions = yield from body.motions(targets(fragment), permits.only_hand)
                plan = yield from planning(
                    fragment, turn, world, body.capabilities, without(motions, bars), permits, self._config
                )
                choices = plan.choices
            except Unreferable:
                choices = ()
            if performance.is_over or performance.plan is None or performance.acts[-1] is not act:
                return
            for gesture in first_that_differs(act, choices, bars):
                id = f"{performance.block_id}/{gesture}:again"
                interrupt = InterruptBehavior(id=id, block=performance.fragment.id, behavior=gesture)
                self._tell(SendRequest(keys.BLOCK, interrupt))
        except EngageError:
            pass  # the body does not answer: the realizer will tell
        except Exception as error:
            self._tell(TellMistake(error, f"another choice for fragment {performance.fragment.id}"))
        finally:
            self._is_choosing = False

    # -- ends -----------------------------------------------------------------------------------------------------

    def _follow_end(self, performance: FragmentPerformance) -> None:
        """Draw the consequences of the end of a block for head and discourse."""
        self._follow_gaze(performance)
        self._discourse = self._discourse.without(performance.fragment.id, performance.unmentioned)

    def _block_ended(self, performance: FragmentPerformance) -> None:
        """Draw the consequences of a block that has ended, or that will never be, for its turn, too."""
        now, fragment = self._now, performance.fragment
        self._follow_end(performance)
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
                self._tell(CancelRequest(performance.block_id, why))
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
        signal = TurnSignal(
            id=id, turn=aborted.turn, signal="aborted", actor=aborted.addressee if aborted.is_to_one else ""
        )
        request = SignalTurn(id=f"{self._session}/{id}", signal=signal, at=Stamp(self._clock.name, now))
        self._tell(SendRequest(keys.TURN, request))
