"""People who talk among themselves, and with the robot when it asks them. Pure.

They know of each other and hear the robot, whom it calls by name, or looks at. The truth, who said what to whom and
when, is kept beside what perception tells of it (`said`): it tells looks, voices and words, and to whom they are only
if it is asked to.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from heapq import heappop, heappush
from itertools import count
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import speaking_time
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.simulation.chance import Chance
from engage_hri.services.simulation.company import Company
from engage_hri.services.simulation.human import AWAY, Act, Human, LookAt, Pause, Start, Stop
from engage_hri.services.simulation.party_habits import PartyHabits
from engage_hri.services.simulation.party_words import TO_ROBOT, answer, turn
from engage_hri.services.simulation.speech import HeardSpeech, Hearing, speech

NAMES = ("ann", "bob", "cy", "dee", "eve", "flo", "gus", "hal")
FEEDBACK = ("mhm", "yeah", "uh-huh", "right")
NOD: Seconds = 0.5
AGAIN: Seconds = 0.5
"""Time after which somebody who has to wait tries again."""
Kind = Literal["talk", "answer", "feedback", "laugh"]


class ScriptLine(Struct, frozen=True):
    """A line of a script: `actor` says `words` to `to`, `after` seconds after the line before has ended."""

    actor: str
    to: str
    words: str
    after: Seconds = 0.5


class Saying(Struct, frozen=True):
    """The truth of what was said. to: actor id. words: empty for a laugh."""

    actor: str
    to: str
    kind: Kind
    words: str
    began: Seconds
    ended: Seconds


class _Plan(Struct, order=True):
    at: Seconds
    number: int
    step: Callable[[Seconds], object]


class Party(Company):
    """The people.

    people: their ids, by which the robot calls them. script: what they say; None: it is drawn, without end.
    tells: perception knows to whom they speak. said: the truth; its reader may take out what it has read.
    """

    def __init__(
        self,
        people: Sequence[str],
        chance: Chance,
        robot: str = "robot",
        life: str = "",
        *,
        habits: PartyHabits = PartyHabits(),  # noqa: B008
        script: Iterable[ScriptLine] | None = None,
        tells: bool = False,
    ) -> None:
        super().__init__({person: Human(()) for person in people}, robot, life)
        self.people = tuple(people)
        self.said: list[Saying] = []
        self._chance, self._robot, self._habits, self._tells = chance, robot, habits, tells
        self._script = None if script is None else iter(script)
        self._next = None if self._script is None else next(self._script, None)
        self._plans: list[_Plan] = []
        self._numbers = count()
        self._hearing = Hearing(robot)
        self._speaking: dict[str, Seconds] = {}
        """Until when each person speaks, or has spoken last."""
        self._attends: dict[str, str] = {}
        """Whom each person looks at, but for looks away."""
        self._away: set[str] = set()
        self._last: Saying | None = None
        """What was said last that took the floor."""
        self._asked: set[str] = set()
        """Who has been asked by the robot, and has not answered yet."""
        self._robot_speaks = False
        self._robot_ended: Seconds = 0.0
        self._robot_looks = ""
        self._are_quiet = False
        """They are silent while the robot speaks, and waits for an answer."""

    def begin(self, now: Seconds) -> None:
        """Let them begin to talk."""
        self._plan(now + AGAIN, self._talk)
        for person in self.people:
            self._plan(now + self._chance.expovariate(1 / self._habits.away_every), partial(self._glance, person))

    @property
    def deadline(self) -> Seconds | None:
        times = (super().deadline, self._plans[0].at if self._plans else None)
        return min((at for at in times if at is not None), default=None)

    def advance(self, now: Seconds, stamp: Stamp) -> Iterator[ActionEvent | Utterance]:
        while self._plans and self._plans[0].at <= now:
            heappop(self._plans).step(now)
        yield from super().advance(now, stamp)

    def _plan(self, at: Seconds, step: Callable[[Seconds], object]) -> None:
        heappush(self._plans, _Plan(at, next(self._numbers), step))

    # -- talk among themselves ----------------------------------------------------------------------------------

    def _talk(self, now: Seconds) -> None:
        """Take the next turn, and plan the one after it."""
        if self._are_quiet and (self._robot_speaks or self._asked):
            self._plan(now + AGAIN, self._talk)
            return
        if self._script is not None:
            self._recite(now)
        elif (line := self._drawn(now)) is None:
            self._plan(now + AGAIN, self._talk)
        else:
            habits, chance = self._habits, self._chance
            seconds = speaking_time(line.words) if line.words else habits.turn.draw(chance)
            before = self._last.words if self._last is not None and self._last.actor == line.to else ""
            said = self._take_turn(line, line.words or turn(before, seconds, chance), seconds, now)
            if chance.random() < habits.laughs:
                self._plan(said.ended, partial(self._laugh, line.actor))
            gap = habits.answer if line.to == self._robot else habits.gap
            self._plan(max(now + AGAIN, said.ended + gap.draw(chance)), self._talk)

    def _recite(self, now: Seconds) -> None:
        """Say the next line of the script."""
        line, self._next = self._next, next(self._script or iter(()), None)
        if line is not None:
            said = self._take_turn(line, line.words, speaking_time(line.words), now)
            if self._next is not None:
                self._plan(max(now, said.ended + self._next.after), self._talk)

    def _take_turn(self, line: ScriptLine, words: str, seconds: Seconds, now: Seconds) -> Saying:
        self._last = self._say(line.actor, line.to, "talk", words, seconds, now)
        return self._last

    def _drawn(self, now: Seconds) -> ScriptLine | None:
        """Draw who speaks to whom. None: nobody can now."""
        chance, last = self._chance, self._last
        free = [each for each in self.people if self._is_free(each, now)]
        if not free:
            return None
        if last is not None and last.to in free and chance.random() < self._habits.replies:
            return ScriptLine(last.to, last.actor, "")
        actor = chance.choice(free)
        others = [each for each in self.people if each != actor]
        is_robots_turn = self._robot_speaks or self._asked
        if not others or (chance.random() < self._habits.addresses_robot and not is_robots_turn):
            return ScriptLine(actor, self._robot, chance.choice(TO_ROBOT))
        return ScriptLine(actor, chance.choice(others), "")

    def _say(self, actor: str, to: str, kind: Kind, words: str, seconds: Seconds, now: Seconds) -> Saying:
        said = Saying(actor, to, kind, words, now, now + seconds)
        self.said.append(said)
        self._speaking[actor] = said.ended
        self._does(actor, now, *speech(words, seconds, (to,) if self._tells else ()))
        self._attend(actor, to, now)
        if kind in ("talk", "answer"):
            if seconds > self._habits.long_turn and self._chance.random() < self._habits.away_at_beginning:
                self._look_away(actor, self._habits.away.bounds[0], now)
            self._listen(actor, to, now)
        return said

    def _listen(self, speaker: str, to: str, now: Seconds) -> None:
        """Let the others look at who has begun to speak, and the addressee give feedback."""
        for each in self.people:
            if each != speaker and (each == to or self._chance.random() < self._habits.look_at_speaker):
                self._plan(now + self._chance.uniform(*self._habits.look), partial(self._attend_to, each, speaker))
        if to in self.people:
            self._plan_feedback(to, speaker, now)

    def _attend_to(self, person: str, speaker: str, now: Seconds) -> None:
        """Look at who speaks, unless the person speaks, or is to answer the robot."""
        if self._is_silent(person, now) and person not in self._asked:
            self._attend(person, speaker, now)

    # -- signs of listeners -------------------------------------------------------------------------------------

    def _plan_feedback(self, listener: str, speaker: str, now: Seconds) -> None:
        habits = self._habits
        every = habits.feedback_to_robot_every if speaker == self._robot else habits.feedback_every
        self._plan(now + AGAIN + self._chance.expovariate(1 / every), partial(self._feed_back, listener, speaker))

    def _feed_back(self, listener: str, speaker: str, now: Seconds) -> None:
        if not (self._robot_speaks if speaker == self._robot else not self._is_silent(speaker, now)):
            return
        habits, chance = self._habits, self._chance
        if self._is_silent(listener, now) and self._attends.get(listener) == speaker:
            only = chance.random() < habits.nods_only
            if only or chance.random() < habits.nods:
                self._does(listener, now, Start("nod"), Pause(NOD), Stop("nod"))
            if not only:
                self._say(listener, speaker, "feedback", chance.choice(FEEDBACK), habits.feedback.draw(chance), now)
        self._plan_feedback(listener, speaker, now)

    def _laugh(self, about: str, now: Seconds) -> None:
        """Let some laugh about what one of them has said."""
        for each in self.people:
            if each != about and self._is_free(each, now) and self._chance.random() < 1 / 2:
                self._say(each, about, "laugh", "", self._chance.uniform(*self._habits.laugh), now)

    # -- looks --------------------------------------------------------------------------------------------------

    def _attend(self, person: str, target: str, now: Seconds) -> None:
        self._attends[person] = target
        if person not in self._away:
            self._does(person, now, LookAt(target))

    def _glance(self, person: str, now: Seconds) -> None:
        """Look away, now and then."""
        self._look_away(person, seconds := self._habits.away.draw(self._chance), now)
        after = self._chance.expovariate(1 / self._habits.away_every)
        self._plan(now + seconds + after, partial(self._glance, person))

    def _look_away(self, person: str, seconds: Seconds, now: Seconds) -> None:
        if person not in self._away:
            self._away.add(person)
            self._does(person, now, LookAt(AWAY))
            self._plan(now + seconds, partial(self._look_back, person))

    def _look_back(self, person: str, now: Seconds) -> None:
        self._away.discard(person)
        self._does(person, now, LookAt(self._attends.get(person, AWAY)))

    # -- the robot ----------------------------------------------------------------------------------------------

    def _hear(self, message: Message, now: Seconds) -> None:
        match message:
            case ActionBegan(actor=self._robot, action="look", targets=targets):
                self._robot_looks = targets[0] if targets else ""
                if self._robot_looks in self.people:
                    after = self._chance.uniform(*self._habits.look)
                    self._plan(now + after, partial(self._attend_to, self._robot_looks, self._robot))
            case ActionBegan(actor=self._robot, action="speak"):
                self._robot_speaks = True
                self._are_quiet = self._chance.random() < self._habits.yields
                self._listen(self._robot, self._robot_looks, now)
            case ActionEnded(actor=self._robot, action="speak"):
                self._robot_speaks, self._robot_ended = False, now
        heard = self._hearing.feed(message)
        if heard is not None and heard.is_question:
            self._is_asked(heard, now)

    def _is_asked(self, heard: HeardSpeech, now: Seconds) -> None:
        """Let who has been asked answer, or another in their place."""
        habits, chance = self._habits, self._chance
        words = heard.words.split()
        called = [each for each in self.people if each in (words[0], words[-1])] if words else []
        asked = called[0] if called else self._robot_looks
        if asked not in self.people:
            return
        others = [each for each in self.people if each != asked and self._is_silent(each, now)]
        if others and chance.random() < habits.answers_for_another:
            asked = chance.choice(others)
        self._asked.add(asked)
        self._plan(
            max(now, self._robot_ended + habits.answer.draw(chance)), partial(self._answer, asked, heard.words)
        )
        if self._is_silent(asked, now):
            self._attend(asked, self._robot, now)

    def _answer(self, person: str, question: str, now: Seconds) -> None:
        if self._is_silent(person, now):
            self._asked.discard(person)
            words = answer(question, self._chance)
            self._last = self._say(person, self._robot, "answer", words, speaking_time(words), now)
        else:
            self._plan(self._speaking[person] + self._habits.look[0], partial(self._answer, person, question))

    # -- what somebody does -------------------------------------------------------------------------------------

    def _is_silent(self, person: str, now: Seconds) -> bool:
        return self._speaking.get(person, now) <= now

    def _is_free(self, person: str, now: Seconds) -> bool:
        """True if the person may take a turn: one to whom the robot speaks, or who is to answer it, does not."""
        is_spoken_to = self._robot_speaks and person == self._robot_looks
        return self._is_silent(person, now) and person not in self._asked and not is_spoken_to

    def _does(self, person: str, now: Seconds, *acts: Act) -> None:
        self._humans[person].schedule(acts, now)
