"""Talk of one to five people and the robot, drawn at random."""

import random

from engage_hri.schemas.behaviors import Action
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import LIMIT, LISTENING, NAMES, OTHER, Absence, Instant, Span, Timeline, Turn

LATE_HEAD = 0.6
"""Seconds by which the head of who speaks is late at most: heads turn with the voice, or after it."""


class Drawing:
    """A timeline that is drawn. grid: all times are multiples of it, so that many are the same."""

    SIZES: tuple[int, ...] = (1, 1, 2, 3, 4, 5)
    """Numbers of people."""

    def __init__(self, seed: int) -> None:
        self._chance = chance = random.Random(seed)
        self._grid = chance.choice((0.001, 0.1, 0.1))
        self.timeline = Timeline(NAMES[: chance.choice(self.SIZES)], is_worded=chance.random() < 0.5)
        if len(self.timeline.people) > 1:
            self.timeline.tells = chance.choice(("early", "late", ""))
            self.timeline.is_worded |= bool(self.timeline.tells)
        self._end = chance.uniform(20.0, 60.0)
        for person in self.timeline.people:
            self._draw_presence(person)
        for person in self.timeline.people:
            self._draw_person(person)
        self._draw_robot()

    def _at(self, seconds: float) -> Instant:
        return round(round(seconds / self._grid) * self._grid, 6), self._chance.randrange(1_000_000)

    def _between(self, least: float, most: float) -> float:
        return self._chance.uniform(least, most)

    def _draw_presence(self, person: str) -> None:
        if self._chance.random() < 0.2:
            since = self._between(5.0, 50.0)
            until = since + self._chance.choice((1.0, self._between(4.0, 12.0)))
            self.timeline.away.append(Absence(person, self._at(since), self._at(until)))

    def _is_away(self, person: str, since: float, until: float) -> bool:
        away = [each for each in self.timeline.away if each.who == person]
        return any(each.since[0] - 0.5 < until and since < each.until[0] + 0.5 for each in away)

    def _draw_person(self, person: str) -> None:
        """Speeches, with nods and points beside them, before and after."""
        chance, at = self._chance, self._between(0.5, 5.0)
        others = [each for each in self.timeline.people if each != person]
        while at < self._end:
            lasts = chance.choice((self._between(0.2, 0.8), 0.8, self._between(0.8, 1.5), self._between(1.0, 4.0)))
            here = [each for each in others if not self._is_away(each, at - 3.0, at + lasts + 3.0)]
            to = chance.choice((ROBOT, *here)) if chance.random() < 0.5 else ROBOT
            if not self._is_away(person, at - 0.3, at + lasts + 0.3):
                self._speak(person, to, at, lasts)
                if to == ROBOT:
                    self._gesture(person, at, at + lasts)
            at += lasts + chance.choice((self._between(0.15, 1.0), self._between(0.5, 6.0), self._between(2.0, 10.0)))

    def _speak(self, person: str, to: str, at: float, lasts: float) -> None:
        chance, since, until = self._chance, self._at(at), self._at(at + lasts)
        if until[0] - since[0] < 0.1:
            return
        since = since[0], NAMES.index(person)  # who is observed first of two that begin together, does not matter
        one = Span(person, "speak", since, until, to, told=to if self.timeline.tells else "")
        if self.timeline.is_worded and chance.random() < 0.8:
            one.words = chance.choice((*LISTENING, *OTHER) if one.seconds < 2.5 else OTHER)
            is_alone = len(self.timeline.people) == 1
            one.known = self._at(until[0] + (chance.choice((0.0, 0.1)) if is_alone or one.seconds < 1.3 else 0.0))
            one.known = max(one.known, (until[0], until[1] + 1))
        self.timeline.spans.append(one)
        if len(self.timeline.people) > 1:
            turns = since[0] + chance.choice((-0.05, self._between(0.0, min(LATE_HEAD, 0.45 * one.seconds))))
            self.timeline.spans.append(Span(person, "look", (round(turns, 6), 0), (round(until[0] + 0.05, 6), 0), to))

    def _gesture(self, person: str, since: float, until: float) -> None:
        chance = self._chance
        if chance.random() < 0.4:
            return
        action: Action = chance.choice(("nod", "nod", "shake", "point"))
        begins = self._at(self._between(since, until))
        ends = self._at(
            min(begins[0] + self._between(0.2, 0.8), until + 0.05 if len(self.timeline.people) > 1 else 1e9)
        )
        is_again = any(
            each.who == person and each.action == action and begins < each.until for each in self.timeline.spans
        )
        if ends[0] - begins[0] >= 0.1 and not is_again:  # nobody nods twice at a time
            self.timeline.spans.append(Span(person, action, begins, ends))

    def _draw_robot(self) -> None:
        """Turns, one after the other: some begin soon after somebody's words, or before these have ended."""
        chance, at = self._chance, self._between(0.5, 4.0)
        spoken = [each for each in self.timeline.spans if each.action == "speak" and each.to == ROBOT]
        while at < self._end:
            to, kind = chance.choice(self.timeline.people), chance.choice(("asks", "asks", "asks", "replies"))
            following = [each for each in spoken if at + 0.5 < each.until[0] < at + 6.0]
            if following and chance.random() < 0.6:
                one = chance.choice(following)
                to, at = (
                    one.who,
                    max(at, one.until[0] + chance.choice((self._between(-0.5, 2.0), self._between(0, 6.0)))),
                )
            waiting = [each for each in self.timeline.turns if at < each.until[0] + LIMIT]
            if waiting and len(self.timeline.people) > 1:
                kind = "asks"  # else it depends on what is known first: who answers, or that who was asked does not
            speech, over = [], at
            for _ in range(chance.choice((1, 1, 2)) if kind == "asks" else 1):
                begins = self._at(over)
                if len(self.timeline.people) > 1:  # not with somebody's words: that would be right either way
                    begins = round(begins[0] + 0.003, 6), -1
                over = begins[0] + self._between(0.5, 3.0)
                speech.append((begins, self._at(over)))
                over += self._between(0.2, 1.0)
            last = speech[-1][1]
            until = (last[0], last[1] + 1)
            if kind == "asks" and chance.random() < 0.3:
                until = max(until, self._at(last[0] + self._between(0.0, 0.5)))
            asked = self._asked(to, kind, at, until[0])
            if asked:
                turn = Turn(f"turn{len(self.timeline.turns)}", kind, asked, speech, until)
                turn.is_aborted = kind == "asks" and chance.random() < 0.15
                if turn.is_aborted and len(self.timeline.people) > 1:  # words after the cut: it depends on what waits
                    for one in spoken:
                        if one.who in asked and one.known is not None and one.until <= until <= one.known:
                            one.known = one.until[0], one.until[1] + 1
                self.timeline.turns.append(turn)
                if self.timeline.is_worded and not turn.is_aborted:
                    self._draw_late_words(turn)
            at = until[0] + chance.choice((self._between(0.2, 2.0), self._between(0.5, 9.0)))

    def _asked(self, to: str, kind: str, at: float, until: float) -> tuple[str, ...]:
        """To whom a turn of this kind is: to this person, if that is there."""
        return () if self._is_away(to, at - 2.5, until + 0.1) else (to,)

    def _draw_late_words(self, turn: Turn) -> None:
        """Let words of what is said into the robot's words come when it has been decided that there are none.

        Of several people only where nothing else depends on when these are known: a nod beside them, or words before.
        """
        for one in self.timeline.spans:
            is_within = any(since < one.since and one.until < until for since, until in turn.speech)
            if one.action == "speak" and one.to == ROBOT and is_within and self._chance.random() < 0.3:
                beside = [
                    each for each in self.timeline.spans
                    if each.who == one.who and each.action != "look"
                    and one.since[0] - LIMIT < each.until[0] and each.since[0] <= one.until[0]
                ]  # fmt: skip
                if len(self.timeline.people) == 1 or beside == [one]:
                    one.known = self._at(one.until[0] + self._between(0.9, 3.0))
                    one.words = one.words or self._chance.choice((*LISTENING, *OTHER))
