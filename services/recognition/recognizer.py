"""All of recognition as one pure machine: symbolic and raw observations in; effects and derived actions out.

Raw perception decides late what has happened, so observations wait in the order of their times until nothing from
before them can still become known. With symbolic perception alone they wait only when a look ends and no other look
follows: the look may only be interrupted.
"""

import heapq
import math
from collections.abc import Callable
from functools import partial
from itertools import count

from engage_hri.schemas.body import RobotState, WordSpoken
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Looked,
    VoiceActivity,
)
from engage_hri.schemas.recognition import ConnectionEvent, HeadHabit, RequestEvent, SignalTurn
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.interrupted_looks import InterruptedLooks, Symbolic
from engage_hri.services.recognition.events.limits import BLOCKS_KEPT
from engage_hri.services.recognition.events.machine import Effect, Mishap, PersonForgotten
from engage_hri.services.recognition.events.scene import Covered
from engage_hri.services.recognition.events.session import SETTLING, Observation, Session
from engage_hri.services.recognition.perceive.attention import Attention
from engage_hri.services.recognition.perceive.words import TimedWords, Words
from engage_hri.services.reports.ongoing_actions import GoesOn
from engage_hri.services.reports.same_people import renamed

OLDEST: Seconds = 0.5
"""Greatest age at which a head pose or a voice level that arrives still counts: an older one tells of what has been
decided. Ours."""
HALF_SURE: Probability = 0.5
"""Confidence above which a meeting of eyes is learned from: a look at one of two has half of it."""
Perceived = Observation | HeadPose | Looked | VoiceActivity | RobotState | WordSpoken | TimedWords
Result = Effect | Symbolic
"""The actions among them were derived from raw perception; the session gets them without another call."""


class Recognizer:
    """Recognition of one robot. robot, clock, name, strict: as of `Session`; if not strict, nothing here raises."""

    def __init__(
        self, robot: str, config: RecognitionConfig, *, clock: str = "loop", name: str = "", strict: bool = True
    ) -> None:
        self.session = Session(robot, config, clock=clock, name=name, strict=strict)
        self.former_until: Seconds = -math.inf
        """Time until which a former life has told all events, as far as is known."""
        self._strict = strict
        self._config = config
        self._new_attention = partial(Attention, robot, config, clock)
        self._attention = self._new_attention()
        self._interrupted = InterruptedLooks()
        self._words = Words(clock)
        self._waiting: list[tuple[Seconds, int, Observation | Covered]] = []
        self._numbers = count()
        self._mishaps: list[Mishap] = []
        """Bugs that have shown and are not reported yet."""
        self._covered = Covered(frozenset())
        self._now: Seconds = -math.inf
        self._heads: dict[str, Probability | None] = {}
        """How much the heads of people attend to the robot."""
        self._unaddressed: Latest[str, Seconds] = Latest(BLOCKS_KEPT)
        """Blocks in which the robot began to speak, in company, before it was known to whom; and when."""

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do, unless an observation comes first."""
        settled, due = self._settled, self.session.deadline
        more = settled + SETTLING  # by then at the latest more is settled
        times = [self._attention.deadline, self._interrupted.deadline]
        if self._waiting:
            times.append(more)
        if due is not None:
            times.append(due if due < settled else max(due, more))
        return min((at for at in times if at is not None), default=None)

    def feed(self, observation: Perceived, at: Seconds, now: Seconds) -> list[Result]:
        """Take what happened at `at`, before or at `now`. A time that is no number is taken for now."""
        self._now = now
        at = at if math.isfinite(at) else now
        derived: list[Symbolic] = []
        match observation:
            case HeadPose() | Looked() | VoiceActivity():
                if now - at <= OLDEST:
                    derived = self._attend(lambda attention: attention.feed(observation, at), at)
            case RobotState():
                derived = self._attend(lambda attention: attention.feed(observation, at), at)
                if self.session.scene.robot_speaks_since is not None:
                    self._wait(observation, at)
            case World():
                derived = self._attend(lambda attention: attention.feed(observation, at), at)
                self._wait(observation, at)
                if (covered := self._attention.covered) != self._covered:
                    self._covered = covered
                    self._wait(covered, at)
            case WordSpoken(word=word):
                self._words.own.says(word, at)
            case ActionBegan(confidence=confidence) | TimedWords(confidence=confidence) if (
                confidence < self._config.least_confidence
            ):
                pass
            case TimedWords():
                derived = self._hear(observation, at)
            case GoesOn(began=began) if began.confidence < self._config.least_confidence:
                pass
            case GoesOn(began=began) if began.actor != self.session.robot:
                derived = self._report(began, at, observation)
            case ActionBegan() | ActionEnded() | ActorFound() | ActorLost() if (
                observation.actor != self.session.robot
            ):
                derived = self._report(observation, at, observation)
            case _:
                self._wait(observation, at)
        return self._take(derived)

    def advance(self, now: Seconds) -> list[Result]:
        """Take all steps that are due up to and including `now`."""
        self._now = now
        for when, ended in self._interrupted.advance(now):
            self._wait(ended, when)
        results = self._take(self._attend(lambda attention: attention.advance(now), now))
        settled = self._settled
        # What is due at the very moment from which on things are undecided has to wait, too.
        until = now if settled > now else math.nextafter(settled, -math.inf)
        return self._told([*results, *self.session.advance(until)])

    def presences(self) -> dict[str, bool]:
        """Presence of who has come, or left, since the last call: true if here. A head that left attends no more."""
        changed = self.session.presences()
        for id, is_here in changed.items():
            if not is_here:
                self._heads.pop(id, None)
        return changed

    def contacts(self) -> dict[str, Probability | None]:
        """Contact of each person with the robot, of those for whom it may have changed since the last call.

        By what the session knows, or by how much the head attends to the robot, whichever is more; None: by neither.
        """
        changed = self.session.contacts()
        for id, much in self._attention.attended.items():
            if id in self.session.persons:
                self._heads[id] = much
                changed.setdefault(id, self.session.persons[id].contact)
        self._attention.attended = {}
        known = {
            id: [each for each in (much, self._heads.get(id)) if each is not None] for id, much in changed.items()
        }
        return {id: max(much, default=None) for id, much in known.items()}

    def heads(self) -> dict[str, HeadHabit]:
        """Take what is known of people's heads, of those of whom something has been learned since the last call."""
        learned, self._attention.learned = self._attention.learned, {}
        return learned

    def resume_head(self, person: str, head: HeadHabit, at: Seconds) -> None:
        """Go on from what a former life has learned of somebody's head."""
        self._attention.resume_head(person, head, at)

    def join(self, other: str, kept: str, at: Seconds, *, speaks: bool) -> list[Result]:
        """Take two persons for one, who is `kept` from now on: see `Session.join`."""
        self._attention.join(other, kept, at)
        self._interrupted.forget(other)
        self._words.join(other, kept)

        def name(id: str) -> str:
            return kept if id == other else id

        self._waiting = [(when, number, renamed(waiting, name)) for when, number, waiting in self._waiting]
        return self._told([*self.session.join(other, kept, at, speaks=speaks)])

    def lose_track(self, person: str, at: Seconds) -> list[Result]:
        """Begin anew with this person after a failure: see `Session.lose_track`."""
        return self._told([*self.session.lose_track(person, at)])

    def _report(self, report: Symbolic, at: Seconds, meaning: Symbolic | GoesOn) -> list[Symbolic]:
        """Take a report of perception, which the session gets as `meaning`."""
        derived = self._attend(lambda attention: attention.take_report(report, at), at)
        for when, told in self._interrupted.feed(report, at):
            self._wait(meaning if told is report else told, when)
        return derived

    def _hear(self, words: TimedWords, at: Seconds) -> list[Symbolic]:
        """Take words. Returns the speech that they are, if nothing else has told of it."""
        worded = self._words.hear(words, at)
        if worded is None:
            return []
        self._wait(worded, worded.since if worded.is_alone else at)
        return [*self._words.speech(words)] if worded.is_alone else []

    def _attend(self, derive: Callable[[Attention], list[Symbolic]], at: Seconds) -> list[Symbolic]:
        """Derive actions from raw perception. If that fails, a new `Attention` begins with nothing."""
        try:
            return derive(self._attention)
        except Exception as error:
            if self._strict:
                raise
            self._mishaps.append(Mishap("", at, error))
            ends = self._attention.give_up(at)
            self._attention = self._new_attention()
            return ends

    def _take(self, derived: list[Symbolic]) -> list[Result]:
        for action in derived:
            self._wait(action, action.at.seconds)
        settled = self._settled
        results: list[Result] = [*derived]
        while self._waiting and self._waiting[0][0] <= settled:
            at, _, observation = heapq.heappop(self._waiting)
            try:
                results += self.session.feed(observation, at)
            except Exception as error:
                if self._strict:
                    raise
                self._mishaps.append(Mishap("", at, error))
        return self._told(results)

    def _told(self, results: list[Result]) -> list[Result]:
        for result in results:
            if isinstance(result, ConnectionEvent) and result.kind == "mutual_facial_gaze":
                met = result.state == "succeeded" and result.confidence > HALF_SURE
                person = result.person(self.session.robot)
                self._attention.knows(person, "mutual", self.session.robot if met else "")
            if isinstance(result, PersonForgotten):
                self._interrupted.forget(result.actor)
                self._words.forget(result.actor)
                self._heads.pop(result.actor, None)
        mishaps, self._mishaps = self._mishaps, []
        return [*results, *mishaps]

    def _wait(self, observation: Observation | Covered, at: Seconds) -> None:
        if isinstance(observation, ActionBegan) and at <= self.former_until:
            observation = GoesOn(began=observation, since=at)
        match observation:
            case RequestEvent() | SignalTurn():
                self.session.announce(observation)
                self._unaddressed.pop(observation.block, None)
            case ActionBegan(actor=self.session.robot, action="speak", behavior=behavior) if (
                self.session.in_company and self.session.addressees_of(behavior) is None
            ):
                self._unaddressed[behavior.rpartition(":")[0]] = math.nextafter(at, -math.inf)  # it waits itself
            case ActionBegan(actor=actor) | ActionEnded(actor=actor) if actor != self.session.robot:
                self._words.follow(observation, at)
            case GoesOn(began=began, since=since) if began.actor != self.session.robot:
                self._words.follow(began, since)
            case ActionBegan(action="speak"):
                self._words.own.begins(at)
        heapq.heappush(self._waiting, (at, next(self._numbers), observation))

    @property
    def _settled(self) -> Seconds:
        """Time before which nothing more can become known, except what takes longer than the time to settle."""
        longest = SETTLING
        undecided = (*self._attention.undecided, *self._interrupted.undecided, *self._unaddressed.values())
        return min((since for since in undecided if self._now < since + longest), default=math.inf)
