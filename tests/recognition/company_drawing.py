"""Talk of two to five people and a robot that speaks to one, several or all of them, drawn at random.

Looks, words and what perception tells contradict each other now and then: people look at a neighbor while they say
the robot's name, at nobody while they answer, and talk about who is there.
"""

import random

from tests.recognition.drawing import LATE_HEAD, Drawing
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import CALLED, LISTENING, NAMES, OTHER, Join, Span, Turn

CALLS = (
    "{}, {}", "{} {}", "{1}, {0}", "stop {0}", "Hey {0}, {1}", "hello {0}, {1}", "{0}さん、見て", "{1}, {0}!",
    "{0}、見て", "赤いのを取って、{0}。", "{0}、赤いのを取って。",
)  # fmt: skip
"""Words that call somebody, and say something."""
MENTIONS = (
    "I think {0} has the red one", "that is what I have told {0}", "look, {0} has it there",
    "赤いのを取って。でも、これもいい。それは{0}",
)  # fmt: skip
"""Words about somebody."""
FIRST_LAST = 10.0
"""Seconds that belong to the first words of all."""
LONGEST_UNSURE = 2.5
"""Longest speech, in seconds, of which words and looks contradict each other: nobody decides before it is over."""


class CompanyDrawing(Drawing):
    """A timeline of company."""

    SIZES = (2, 3, 4, 5)

    def __init__(self, seed: int) -> None:
        self._habits = habits = random.Random(f"{seed} habits")
        self._blind = {each for each in NAMES if habits.random() < 0.15}
        """People of whom no look is ever told."""
        self._silent = {each for each in NAMES[2:] if habits.random() < 0.15}
        super().__init__(seed)
        self._leave_words_alone()
        if self.timeline.is_worded and not self.timeline.tells and habits.random() < 0.4:
            self._draw_first_words()
        self.timeline.unseen = frozenset(each for each in self.timeline.people if habits.random() < 0.15)

    def _speak(self, person: str, to: str, at: float, lasts: float) -> None:
        chance, since, until = self._chance, self._at(at), self._at(at + lasts)
        if until[0] - since[0] < 0.1:
            return
        is_unsure = until[0] - since[0] < LONGEST_UNSURE and chance.random() < 0.4
        one = Span(person, "speak", (since[0], NAMES.index(person)), until, to)
        tells, people = self.timeline.tells, [ROBOT, *self.timeline.people]
        one.told = to if tells and not (is_unsure and chance.random() < 0.3) else ""
        if self.timeline.is_worded and chance.random() < (0.95 if tells else 0.8):
            one.words = self._words(one, is_unsure=is_unsure)
            late = chance.choice((0.0, 0.1, self._between(0.0, 1.3 - one.seconds))) if one.seconds < 1.3 else 0.0
            one.known = max(self._at(until[0] + late), (until[0], until[1] + 1))
        if tells == "late" and not one.words:
            one.told = ""
        self.timeline.spans.append(one)
        if self.timeline.is_worded:
            self._hear_partly(one)
        target = "" if person in self._blind else chance.choice((to, "", *people)) if is_unsure else to
        if target in ("", person):
            return
        turns = since[0] + chance.choice((-0.05, self._between(0.0, min(LATE_HEAD, 0.45 * one.seconds))))
        if self._habits.random() < 0.3:
            turns = self._at(turns)[0]
        looked = [each.until[0] for each in self.timeline.spans if each.who == person and each.action == "look"]
        turns = max([turns, *(end + 0.01 for end in looked)])
        self.timeline.spans.append(Span(person, "look", (round(turns, 6), 0), (round(until[0] + 0.05, 6), 0), target))

    def _draw_first_words(self) -> None:
        """Draw the first words of all, long before the rest: nobody knows yet that there will be any."""
        self.timeline.delay(FIRST_LAST)
        habits, who = self._habits, self._habits.choice(self.timeline.people)
        one = Span(who, "speak", (2.0, 0), (2.0 + habits.choice((0.4, 1.0)), 1), ROBOT)
        one.known = round(one.until[0] + habits.choice((0.0, 0.3, 1.5, 2.5)), 6), 2
        one.words = self._words(one, is_unsure=True)
        others = [each for each in self.timeline.people if each != who]
        if face := habits.choice((ROBOT, "", habits.choice(others))):
            self.timeline.spans.append(Span(who, "look", (1.0, 0), (3.5, 0), face))
        self.timeline.spans.append(one)
        self.timeline.is_first = True

    def _leave_words_alone(self) -> None:
        """Let nothing but the words tell of a speech, and type some of them: where nothing else is at that time."""
        turns = [(since[0], until[0]) for turn in self.timeline.turns for since, until in turn.speech]
        for one in self.timeline.spans:
            if one.action != "speak" or one.known is None or one.seconds > 1.3 or one.known[0] > one.until[0] + 0.1:
                continue
            rest = [
                each for each in self.timeline.spans
                if each is not one and each.since[0] < one.known[0] + 0.7 and one.since[0] - 0.7 < each.until[0]
            ]  # fmt: skip
            if any(each.who == one.who and each.action != "look" for each in rest):
                continue
            if self._habits.random() < 0.15:
                one.is_alone, one.heard, one.until, one.known = True, (), one.since, (one.since[0], one.since[1] + 1)
            elif all(each.who == one.who for each in rest) and self._habits.random() < 0.5:
                is_crossed = any(one.since[0] - 0.4 < at < one.known[0] + 0.4 for speech in turns for at in speech)
                one.is_alone, one.heard = not is_crossed, () if not is_crossed else one.heard

    def _hear_partly(self, one: Span) -> None:
        """Let partial words come while somebody speaks: any, also names of others than who is called in the end."""
        habits, step = self._habits, round(0.3 / self._grid) * self._grid
        for number in range(1, int(one.seconds / 0.3)):
            if one.words and habits.random() < 0.2:
                text = habits.choice((one.words.split()[0], "bob", "robot", "stop", "uh"))
                one.heard = (*one.heard, ((round(one.since[0] + number * step, 6), 3), text))

    def _draw_person(self, person: str) -> None:
        if person not in self._silent:
            super()._draw_person(person)

    def _words(self, one: Span, *, is_unsure: bool) -> str:
        chance = self._chance
        if not is_unsure or chance.random() < 0.4:
            return chance.choice((*LISTENING, *OTHER) if one.seconds < LONGEST_UNSURE else OTHER)
        who = chance.choice([each for each in (ROBOT, *self.timeline.people) if each != one.who])
        # "I am Ann" calls nobody. A chance of its own, so that nothing else is drawn anew.
        who = one.who if random.Random(f"{one.who} {one.since}").random() < 0.2 else who
        name = chance.choice((who, who.title(), CALLED.get(who, who)))
        return chance.choice((*CALLS, *MENTIONS)).format(name, chance.choice(OTHER))

    def _gesture(self, person: str, since: float, until: float) -> None:
        spoken = [each for each in self.timeline.spans if each.who == person and each.action in ("speak", "look")][
            -2:
        ]
        if spoken and spoken[-1].action == "look" and spoken[-1].to == ROBOT and spoken[-1].until[0] > until:
            super()._gesture(person, max(since, spoken[-1].since[0] + 0.01), until)

    def _draw_late_words(self, turn: Turn) -> None:
        if len(turn.to) == 1:  # else it depends on when it is known who else has answered
            super()._draw_late_words(turn)

    def _asked(self, to: str, kind: str, at: float, until: float) -> tuple[str, ...]:
        here = [each for each in self.timeline.people if not self._is_away(each, at - 2.5, until + 0.1)]
        if kind != "asks" or to not in here or self._chance.random() < 0.4:
            return super()._asked(to, kind, at, until)
        others = [each for each in here if each != to]
        return (
            to,
            *self._chance.sample(others, self._chance.choice((len(others), self._chance.randint(0, len(others))))),
        )


class JoinDrawing(CompanyDrawing):
    """A timeline of company in which people turn out to be somebody who is known: by another id."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        away = {each.who for each in self.timeline.away}
        people = [each for each in self.timeline.people if each not in away and each not in CALLED]
        for number, who in enumerate(self._chance.sample(people, min(len(people), self._chance.choice((1, 1, 2))))):
            self._draw_join(who, number)

    def _draw_join(self, who: str, number: int) -> None:
        """Draw when it becomes known: at any time, or in the very instant in which somebody begins or ends."""
        chance = self._chance
        instants = [at for each in self.timeline.spans for at in (each.since, each.until)]
        instants += [at for turn in self.timeline.turns for speech in turn.speech for at in speech]
        at = chance.choice(
            (self._at(self._between(1.0, self._end)), (chance.choice(instants)[0], chance.choice((-2, 10**7))))
        )
        kind = chance.choice(("named", "changed", "known"))
        id = f"face_{number}"
        join = Join(who, id, at, is_known=kind == "known" and not self.timeline.away, goes_on=chance.random() < 0.5)
        if kind == "changed":
            join.changes, join.goes_on = (at[0], -3), True
            join.at = self._at(at[0] + self._between(0.1, 1.5))
            if any(
                each.since[0] <= join.at[0] + 0.2 and at[0] - 0.4 <= each.until[0]
                for each in self.timeline.spans
                if each.who == who
            ):
                return
        elif join.is_known:
            self._begin_alone(who)
        else:
            self._order_by_id(who, len(NAMES) + number)
        self.timeline.joins.append(join)

    def _begin_alone(self, who: str) -> None:
        """Let nobody begin to speak with who is known by both ids: it depends on what is open which one counts."""
        begins = {each.since[0] for each in self.timeline.spans if each.action == "speak" and each.who != who}
        for each in self.timeline.spans:
            if each.who == who and each.action == "speak" and each.since[0] in begins:
                is_line, each.since = each.is_line, (each.since[0] + 0.002, each.since[1])
                if is_line:
                    each.until, each.known = each.since, (each.since[0], each.since[1] + 1)

    def _order_by_id(self, who: str, number: int) -> None:
        """Observe somebody in the order of the id by which recognition knows them: it decides between two at once."""
        for each in self.timeline.spans:
            if each.who == who and each.action == "speak":
                each.since = each.since[0], number
                if each.is_alone and each.known is not None:
                    each.until, each.known = (each.until[0], number), (each.known[0], number + 1)
