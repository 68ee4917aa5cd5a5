"""People who talk among themselves, and with the robot when it asks them. Pure.

They know of each other and hear the robot, whom it calls by name, or looks at. The truth, who said what to whom and
when, is kept beside what perception tells of it (`said`): it tells looks, voices and words, and to whom they are only
if it is asked to.

How soon, how long and how often they do what are `PartyHabits`, each with its source. Measured times are drawn from
the deciles of people's own times: these are skewed, and what robots get wrong in talk is at the far end. AMI: two
meetings of four people (AMI Meeting Corpus, CC BY 4.0). IFADV: a quarter of an hour of a dialogue that was coded by
hand. Their replies fit what was said, and their answers what was asked.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from heapq import heappop, heappush
from itertools import count, pairwise
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.services.client.people.actions import WORD, speaking_time
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.simulation.chance import Chance
from engage_hri.services.simulation.company import Company
from engage_hri.services.simulation.human import (
    AWAY,
    Act,
    HeardSpeech,
    Hearing,
    Human,
    LookAt,
    Pause,
    Start,
    Stop,
    speech,
)

# -- habits -------------------------------------------------------------------------------------------------------


class Deciles(Struct, frozen=True):
    """A distribution of times, in ten equally likely parts. bounds: eleven times, growing."""

    bounds: tuple[Seconds, ...]

    def draw(self, chance: Chance) -> Seconds:
        return chance.uniform(*chance.choice(tuple(pairwise(self.bounds))))


class PartyHabits(Struct, frozen=True, kw_only=True):
    """Habits of all who sit together."""

    turn: Deciles = Deciles((0.27, 0.35, 0.7, 1.07, 1.42, 1.92, 2.94, 4.16, 6.06, 9.0, 12.21))
    """Length of what they say. AMI: 399 turns that took the floor; 5 of 100 at either end are left out."""
    gap: Deciles = Deciles((-1.76, -1.11, -0.48, -0.17, 0.07, 0.29, 0.48, 0.73, 1.16, 2.15, 4.46))
    """Time from the end of a turn to the next of another; negative: it begins before that end. The same turns."""
    answer: Deciles = Deciles((0.2, 0.5, 0.8, 1.1, 1.4, 1.6, 1.8, 2.0, 2.5, 3.5, 5.9))
    """Time from the end of the robot's question to the answer: 69 answers of people to a product robot, of a public
    study of turn-taking; one after 61 s is left out."""
    feedback: Deciles = Deciles((0.2, 0.25, 0.3, 0.34, 0.38, 0.42, 0.46, 0.52, 0.6, 0.8, 1.1))
    """Length of a listener's words: IFADV has 9 of 143 above 0.8 s; the lower part is AMI, within others' turns."""
    feedback_every: Seconds = 6.0
    """Mean time between these while somebody speaks to them. IFADV: 143 in a quarter of an hour."""
    feedback_to_robot_every: Seconds = 12.0
    """The same while the robot does. Ours."""
    nods: Probability = 0.5
    """Share of these that come with a nod. Ours."""
    nods_only: Probability = 0.3
    """Share of these that are a nod without words. Ours."""
    laughs: Probability = 0.06
    """Share of the turns after which some laugh. IFADV: 15 laughs in a quarter of an hour."""
    laugh: tuple[Seconds, Seconds] = (0.4, 1.8)
    """Shortest and longest laugh. IFADV: 7 of 15 above 0.8 s."""
    look: tuple[Seconds, Seconds] = (0.2, 0.6)
    """Time in which they look at who has begun to speak. Ours."""
    look_at_speaker: Probability = 0.94
    """Share of the speakers that they look at. IFADV: for 91 to 96 % of the time that they listen."""
    away_every: Seconds = 60.0 / 7
    """Mean time between looks away. IFADV: 5 to 9 a minute."""
    away: Deciles = Deciles((0.5, 0.58, 0.66, 0.74, 0.82, 0.9, 1.05, 1.25, 1.6, 2.3, 3.0))
    """Length of a look away. IFADV: median 0.74 to 1.0 s, 90 of 100 below 2 to 3 s."""
    away_at_beginning: Probability = 0.7
    """Share of their long turns that they begin with a look away. Kendon 1967; IFADV: 20 to 32 % of all turns."""
    long_turn: Seconds = 4.0
    """Length from which a turn is a long one. Ours."""
    replies: Probability = 0.7
    """Share of the turns after which the one who was spoken to speaks next, to the speaker. Ours."""
    addresses_robot: Probability = 0.08
    """Share of the turns that are to the robot. Ours: in a meeting of four one in three would be, of equals."""
    yields: Probability = 0.7
    """Share of the robot's turns during which the others are silent, and wait for the answer. Ours."""
    answers_for_another: Probability = 0.05
    """Share of the robot's questions that another one answers. Ours."""


# -- words --------------------------------------------------------------------------------------------------------


TALK = {
    "I went to the market on Saturday": ("and what did you buy", "I was there as well", "on Saturday it rained"),
    "they had those small pears again": ("I like those", "we could make a cake", "were they expensive"),
    "my sister wants to visit us": ("how nice", "when will she come", "she can have my room"),
    "have you seen the new bridge": ("not yet", "it is beautiful", "we walked over it last week"),
    "it was much colder than last year": ("and it rained all day", "I did not mind", "was there any snow"),
    "so we took the later train": ("was it full", "that was a good idea", "when did you get home"),
    "and then the dog ate all of it": ("all of it", "poor dog", "no way"),
    "we could try that next week": ("next week is fine", "I have no time next week", "let us do that"),
}
"""What opens a subject, with what somebody else may say to it. They do so again and again until the time is over."""
TO_ROBOT = ("What time is it?", "What is that piece called?", "What do you think about it?")
ANSWERS = {
    "are": ("Yes, thank you.", "Not really.", "Quite, thank you."),
    "do": ("Of course I do.", "Yes, I do.", "No, not really."),
    "did": ("Yes, I did.", "No, I did not.", "No, where is it?"),
    "is": ("I think so.", "Yes, it is.", "No, not really."),
    "was": ("Yes, it was.", "A little.", "I think so."),
    "shall": ("Yes, please.", "No, thank you.", "Maybe later."),
    "which": ("The big one.", "This one here.", "I do not know."),
}
"""Answers, by the word with which the question begins, after a name."""
ANY_ANSWER = ("Maybe, I am not sure.", "Why do you ask?")
"""Answers to all other questions."""


def turn(before: str, seconds: Seconds, chance: Chance) -> str:
    """Words of a turn of this length: a reply to the end of the turn before, if that opens a subject, and more."""
    said: list[str] = []
    replies = TALK.get(before.rstrip(".").rsplit(", ", 1)[-1], ())
    subjects = [each for each in TALK if each not in before]
    while not said or speaking_time(", ".join(said)) + WORD < seconds:
        said.append(chance.choice(replies) if replies and not said else chance.choice(subjects))
        subjects = [each for each in subjects if each != said[-1]] or [*TALK]
    return f"{', '.join(said)}."


def answer(question: str, chance: Chance) -> str:
    """Words that answer a question of the robot. question: lower case, without punctuation."""
    begins = next((word for word in question.split() if word in ANSWERS), "")
    return chance.choice(ANSWERS.get(begins, ANY_ANSWER))


# -- people -------------------------------------------------------------------------------------------------------


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
