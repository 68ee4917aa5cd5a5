"""Turns of people as objects: who speaks, to whom, the words as they come, and the end as soon as it is one.

    async for turn in robot.heard():
        async for words in turn:                 # what is understood so far, until the turn is over
            print(turn.who, words)
        print(turn.who, "to", turn.to, "has said", turn.text)

A turn begins with a person's voice, or with words that nobody heard a voice for. When it is over is decided by
turn_ends.py. Words are waited for as long as they may come: a recognizer knows them up to 2 s after the voice. To
whom they are is mostly decided by recognition with them, and told a moment later: who did not wait for that would
answer what people say to each other.
No task runs here: whoever waits takes in what has come, for all that wait.
"""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from math import inf

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost, Utterance
from engage_hri.schemas.recognition import Floor, Interjection, InterjectionReading
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Reading
from engage_hri.services.client.turn_ends import EndOfTurn, PersonPauses, SoFar
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports, events
from engage_hri.services.reports.same_people import PeopleNames

WORDS_PATIENCE: Seconds = 2.0
"""Time after the voice for which a turn waits for words that are on their way, as generation does (decision 0065)."""
ADDRESSEES_PATIENCE: Seconds = 0.2
"""Time after the last words for which a turn waits until it is known to whom it is: the way of the words to
recognition, and of its `Floor` to here. Ours."""
APART: Seconds = 0.05
"""Time by which two processes may differ about when a speech begins or ends."""
RESUMED_WITHIN: Seconds = 1.0
"""A turn that begins so soon after the person's last one was a part of that: its end had been decided too early."""
KNOWN = 256
"""Number of utterances that are remembered after their turns: what comes of them later is no turn."""


class HeardTurn:
    """A turn of a person. who: the person's id. text: the words, as far as they are known.

    began, ended: seconds on this process' clock, as of `Robot.now`; ended: of the last voice or word.
    """

    def __init__(self, feed: "HeardFeed", who: str, began: Seconds) -> None:
        self.who = who
        self.began = began
        self.ended = began
        self._feed = feed
        self._utterances: dict[str, Utterance] = {}
        self._addressed: tuple[str, ...] = ()
        self._reading: InterjectionReading | None = None
        self._speaks = False
        self._is_line = False
        self._understood: Seconds = began
        """When its last words came."""
        self._spoken: Seconds = 0.0
        self._since: Seconds = began
        """When the voice that is heard began."""
        self._is_over = False
        self._version = 0

    @property
    def text(self) -> str:
        """The words so far, of all utterances in the order in which they began."""
        said = sorted(self._utterances.values(), key=lambda each: each.began.seconds)
        return " ".join(word for each in said for word in each.text.split())

    @property
    def to(self) -> tuple[str, ...]:
        """Ids of those to whom it is said; empty: nobody knows."""
        told = dict.fromkeys(id for each in self._utterances.values() for id in each.to)
        return tuple(told) or self._addressed

    @property
    def reading(self) -> InterjectionReading | None:
        """Reading of it, as of `Interjection`, if it was said into a turn of the robot; None: it was not."""
        return self._reading

    @property
    def is_over(self) -> bool:
        """True once it has ended, as far as what was told until now is taken in."""
        return self._is_over

    async def over(self) -> str:
        """Wait until it is over; returns its words."""
        while not self._is_over and await self._feed._advance():
            pass
        return self.text

    async def __aiter__(self) -> AsyncIterator[str]:
        """Follow the words: all of them so far whenever there are others, until the turn is over."""
        told = ""
        while True:
            if (text := self.text) != told:
                told = text
                yield text
            elif self._is_over or not await self._feed._advance():
                return


class HeardFeed(Reading[HeardTurn]):
    """Turns of people from now on: `async for`, or `next` with a timeout. Ends with the client.

    Use it in a `with`, or close it: until then messages are kept even if nobody reads them.
    """

    def __init__(self, bus: Bus, ends: EndOfTurn, language: str) -> None:
        self._bus = bus
        self._ends = ends
        self._language = language
        self._inbox = bus.subscribe(
            keys.UTTERANCE, keys.FLOOR, keys.ANY_INTERJECTION, keys.ANY_ACTION, keys.ROBOT_ONGOING,
            keys.ANY_PERCEIVED_ONGOING, keys.ANY_ROBOT_ALIVE, keys.SAME_PEOPLE,
        )  # fmt: skip
        self._from = bus.now()
        self._reports = ActionReports(bus.robot, REPORT_GRACE, bus.clock, self._instant)
        self._names = PeopleNames()
        self._habits = PersonPauses()
        self._open: dict[str, HeardTurn] = {}
        self._last: dict[str, HeardTurn] = {}
        """The last turn of each person that is over."""
        self._looks: dict[str, bool] = {}
        """Whether each person looks at the robot, as far as somebody tells."""
        self._worded: set[str] = set()
        """People of whom somebody tells words."""
        self._done: dict[tuple[str, str], None] = {}
        """Utterances of turns that are over."""
        self._begun: deque[HeardTurn] = deque()
        self._is_taking = False
        self._changed = asyncio.Event()
        self._is_closed = False

    async def next(self, timeout: Seconds | None = None) -> HeardTurn | None:
        """Return the next turn, as soon as it begins; None after `timeout` seconds without one, or at the end.

        timeout: seconds; None: for ever.
        """
        until = inf if timeout is None else self._bus.now() + timeout
        while not self._begun:
            if not await self._advance(until):
                return None
        return self._begun.popleft()

    def close(self) -> None:
        """End the feed: nothing more comes, and no turn that goes on is told to be over."""
        self._is_closed = True
        self._inbox.close()
        self._wake()

    # -- taking in ----------------------------------------------------------------------------------------------

    async def _advance(self, until: Seconds = inf) -> bool:
        """Wait until something has changed. False: nothing has by `until`, or the feed has ended."""
        if self._is_closed:
            return False
        if self._is_taking:
            try:
                async with asyncio.timeout_at(None if until == inf else until):
                    await self._changed.wait()
            except TimeoutError:
                return False
            return not self._is_closed
        self._is_taking = True
        try:
            return await self._take_next(until)
        finally:
            self._is_taking = False
            self._wake()

    async def _take_next(self, until: Seconds) -> bool:
        due = self._due
        deadline = min(due, until)
        received = await self._inbox.next(None if deadline == inf else deadline)
        if received is not None:
            # What was due before it came happens before it: this may be read long after it was told.
            self._pass(min(received.at, self._bus.now()))
            told = self._reports.take(
                received.message, received.key, received.source, received.life, received.at, past=received.past
            )
            for event, at in events(told, self._bus.clock):
                self._act(event, at)
            if not received.past:
                self._take(received.message, received.at)
            self._names.take(received.message)
            return True
        self._is_closed |= self._bus.now() < deadline
        if self._bus.now() < due:
            return False
        self._pass(self._bus.now())
        return True

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

    @property
    def _due(self) -> Seconds:
        reports = self._reports.deadline
        ends = [self._end_of(turn) for turn in self._open.values()]
        return min([inf if reports is None else reports, *ends])

    def _pass(self, now: Seconds) -> None:
        """Take in that it is `now`: turns end, and actions of reporters who have gone."""
        for event, at in events(self._reports.advance(now), self._bus.clock):
            self._act(event, at)
        for turn in [*self._open.values()]:
            if now >= self._end_of(turn):
                self._end(turn)

    def _instant(self, stamp: Stamp) -> Seconds:
        return min(self._bus.local(stamp), self._bus.now())

    # -- what people do -----------------------------------------------------------------------------------------

    def _act(self, event: Message, at: Seconds) -> None:
        match event:
            case ActionBegan(actor=who, action="speak") if who != self._bus.robot and at >= self._from:
                if self._was_over(who, at):
                    return  # recognition tells of words alone, as a typed line, that they were speech
                turn = self._turn(who, at)
                if not turn._speaks:
                    if turn._spoken:
                        self._habits.note(who, at - turn.ended)
                    turn._speaks, turn._since = True, at
            case ActionEnded(actor=who, action="speak") if (ended := self._open.get(who)) and ended._speaks:
                ended._speaks = False
                ended._spoken += at - ended._since
                ended.ended = max(ended.ended, at)
            case ActionBegan(actor=who, action="look", targets=targets):
                self._looks[who] = self._bus.robot in targets
            case ActionEnded(actor=who, action="look"):
                self._looks.pop(who, None)
            case ActorLost(actor=who):
                self._looks.pop(who, None)
                if (left := self._open.get(who)) is not None:
                    self._end(left)

    def _take(self, message: Message, at: Seconds) -> None:
        match message:
            case Utterance():
                self._understand(self._names.named(message), at)
            case Floor(speeches=speeches, ended=ended):
                for speech in (*ended, *speeches):
                    turn = self._open.get(self._names.name(speech.actor))
                    since = self._instant(speech.since)
                    if turn is not None and speech.to and since >= turn.began - APART:
                        turn._addressed = speech.to
            case Interjection(actor=actor, reading=reading, since=since):
                who = self._names.name(actor)
                for turn in filter(None, (self._open.get(who), self._last.get(who))):
                    if turn.began - APART <= self._instant(since) <= turn.ended + APART or turn._speaks:
                        turn._reading = reading
                        break

    def _understand(self, utterance: Utterance, at: Seconds) -> None:
        who, began = utterance.actor, self._instant(utterance.began)
        key = (who, utterance.id)
        self._worded.add(who)
        if key in self._done:
            return
        if who not in self._open and not utterance.text.strip():
            return  # words may follow, and a voice is what begins a turn
        turn = self._turn(who, min(began, at))
        known = turn._utterances.get(utterance.id)
        if known is not None and (known.final, known.at.seconds) >= (utterance.final, utterance.at.seconds):
            return
        turn._utterances[utterance.id], turn._understood = utterance, at
        if utterance.final:
            turn.ended = max(turn.ended, self._instant(utterance.ended or utterance.at))
        elif known is not None and not turn._speaks and utterance.text != known.text:
            turn.ended = max(turn.ended, at)  # without a voice the words that grow are one
        turn._is_line = utterance.final and utterance.began == utterance.at and not turn._spoken and not turn._speaks

    def _turn(self, who: str, at: Seconds) -> HeardTurn:
        """The turn of a person that goes on, or a new one."""
        if (turn := self._open.get(who)) is None:
            turn = self._open[who] = HeardTurn(self, who, at)
            self._begun.append(turn)
            last = self._last.get(who)
            if last is not None and 0 < at - last.ended <= RESUMED_WITHIN:
                self._habits.note(who, at - last.ended)
        return turn

    def _was_over(self, who: str, at: Seconds) -> bool:
        """True if a turn of the person that is over has that time."""
        last = self._last.get(who)
        return who not in self._open and last is not None and last.began - APART <= at <= last.ended + APART

    # -- its end ------------------------------------------------------------------------------------------------

    def _end_of(self, turn: HeardTurn) -> Seconds:
        """Time at which the turn is over, if nothing more comes."""
        if turn._speaks:
            return inf
        addressed = turn.began if turn.to else turn._understood + ADDRESSEES_PATIENCE
        if turn._is_line:
            return max(turn.ended, addressed)
        is_waited_for = any(not each.final for each in turn._utterances.values()) or (
            turn._reading == "open" or (not turn._utterances and turn.who in self._worded)
        )
        so_far = SoFar(
            who=turn.who,
            text=turn.text,
            spoken=turn._spoken,
            finished=max(turn._utterances.values(), key=_beginning).finished if turn._utterances else None,
            looks_at_robot=self._looks.get(turn.who),
            language=self._language,
            pauses=self._habits.of(turn.who),
        )
        silence = self._ends.silence(so_far)
        return max(turn.ended + (max(silence, WORDS_PATIENCE) if is_waited_for else silence), addressed)

    def _end(self, turn: HeardTurn) -> None:
        turn._is_over, turn._speaks = True, False
        del self._open[turn.who]
        self._last[turn.who] = turn
        for id in turn._utterances:
            self._done[turn.who, id] = None
        while len(self._done) > KNOWN:
            del self._done[next(iter(self._done))]


def _beginning(utterance: Utterance) -> Seconds:
    return utterance.began.seconds
