"""Outcomes of the played blocks and fragments: their events and exit code, the line about each, and warnings.

An outcome comes before its story is over: the answer to a turn, and the words of that answer, come later. So each
outcome waits here until its connection events are decided. Warnings wait, too: a refusal repeats those of its block.
"""

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable

from msgspec.structs import replace
from rich.console import Console

from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.fragments import FragmentOutcome, HeardText, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent
from engage_hri.schemas.summary import summary
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.performing import NewWords
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.commandline.shell.process import DONE, FAILED
from engage_hri.services.commandline.shell.sources import Thing
from engage_hri.services.console import wording
from engage_hri.services.console.wording import deeds

WORDS: Seconds = 2.0
"""Time after an answer in words in which these become known."""
GRACE: Seconds = 0.5
"""Time after its limit in which the end of an event must arrive."""


class Played:
    """Sink that follows the played blocks and fragments and the connection events that they begin."""

    def __init__(self, things: Iterable[Thing]) -> None:
        things = tuple(things)
        self._deeds = {name: deed for thing in things for name, deed in deeds(thing).items()}
        self.blocks = frozenset(thing.id for thing in things)
        self._announced = frozenset(
            (thing.id, behavior.id)
            for thing in things
            if isinstance(thing, Block)
            for behavior in thing.behaviors
            if isinstance(behavior, Event)
        )
        self._events: set[str] = set()
        """Ids of the connection events that have started."""
        self._open: dict[tuple[str, str], ConnectionEvent | None] = {}
        """Events that have not ended, by block and behavior; None until recognition has told of the start."""
        fragments = [thing for thing in things if isinstance(thing, TurnFragment)]
        self._holds_turn = bool(fragments) and fragments[-1].turn_status in ("beginning", "middle")
        self._begun: set[str] = set()
        """Blocks that have begun."""
        self._changed = asyncio.Event()
        self._utterances: dict[tuple[str, str], bool] = {}
        """Utterances by person and id, and whether they are known for good."""
        self._wordless: dict[str, ConnectionEvent] = {}
        """Answers in words that are over, and of which the words are not known."""

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case BlockProgress(block=str() as block, progress="start"):
                self._begun.add(block)
                return
            case WarningFeedback(kind="DEGRADED", block=str() as block, behavior=behavior):
                if deed := self._deeds.get((block, behavior)):
                    self._deeds[block, behavior] = deed.as_warned(message.message)
                return
            case SyncPointProgress(block=block, behavior=behavior, sync="start"):
                # A block may end before recognition has said that the event has started.
                if (block, behavior) in self._announced:
                    self._open.setdefault((block, behavior), None)
            case Utterance(actor=actor, id=id):
                self._utterances[actor, id] = message.final or self._utterances.get((actor, id), False)
            case ConnectionEvent(block=block, state="started") if block in self.blocks:
                self._events.add(message.id)
                self._open[block, message.behavior] = message
            case ConnectionEvent(id=id) if id in self._events and message.state in ENDINGS:
                self._open.pop((message.block, message.behavior), None)
                self._wordless.pop(id, None)
                if self.words_will_come(message):
                    self._wordless[id] = message
            case _:
                return
        self._changed.set()

    def deed(self, message: Message) -> str:
        """Words for what the robot does at a sync point, besides what actions tell of; empty: nothing."""
        if isinstance(message, SyncPointProgress):
            deed = self._deeds.get((message.block, message.behavior))
            if deed is not None and deed.sync == message.sync:
                return deed.words
        return ""

    def concerns(self, message: Message) -> bool:
        """Tell whether a message is about the played things, and so to be written and told."""
        match message:
            case (
                BlockProgress(block=block)
                | SyncPointProgress(block=block)
                | PredictionFeedback(block=block)
                | WarningFeedback(block=block)
            ):
                return block is None or block in self.blocks
            case ConnectionEvent(id=id):
                # The block alone does not tell: it may have been performed before, under the same id.
                return id in self._events
        return True

    async def settle(self) -> None:
        """Wait for the ends of the events that have begun, no longer than their limits from now.

        An adjacency pair of a turn that goes on is not waited for: the next fragment would come too late.
        """
        loop = asyncio.get_running_loop()
        began = loop.time()
        while (limit := self._longest_limit()) is not None:
            self._changed.clear()
            try:
                async with asyncio.timeout_at(began + limit + GRACE):
                    await self._changed.wait()
            except TimeoutError:
                return

    def words_will_come(self, event: ConnectionEvent) -> bool:
        """Tell whether an answer will get words, or more of them: somebody tells those of this person."""
        if event.response != "speak":
            return False
        known = [is_final for (actor, _), is_final in self._utterances.items() if actor == event.responder]
        return bool(known) and not (event.words and all(known))

    def _longest_limit(self) -> Seconds | None:
        """Longest limit of the events that are waited for; None if there are none."""
        limits = [
            event.limit or 0.0 if event else 0.0
            for event in self._open.values()
            if not (self._holds_turn and event and event.kind == "adjacency_pair")
        ]
        limits += [WORDS] * any(map(self.words_will_come, self._wordless.values()))
        return max(limits, default=None)

    def end_before_turn(self, outcome: FragmentOutcome | BlockOutcome) -> str:
        """Tell how a block has ended that never began: no feedback says so. Empty: of another."""
        if not isinstance(outcome, BlockOutcome) or outcome.block in self._begun or outcome.status == "done":
            return ""
        cause = f", replaced by {outcome.replaced_by}" if outcome.replaced_by else ""
        return f"block {outcome.block}: {outcome.status} before its turn came{cause}"

    def exit_code(self, outcome: FragmentOutcome | BlockOutcome) -> int:
        """Exit code of an outcome. A block that another file's REPLACE ended counts as done."""
        return DONE if outcome.status == "done" or outcome.replaced_by in self.blocks else FAILED


class Prose:
    """Sink that prints results and writes them to `--outcomes`.

    Ended fragments wait here for the answer to their turn.
    """

    def __init__(
        self, console: Console, outputs: Outputs, words_will_come: Callable[[ConnectionEvent], bool] = lambda _: False
    ) -> None:
        """words_will_come: tells whether an event will get words."""
        self._console = console
        self._outputs = outputs
        self._words_will_come = words_will_come
        self._waiting: list[FragmentOutcome] = []
        self._events: dict[str, ConnectionEvent] = {}
        self._heard: dict[tuple[str, str], HeardText] = {}
        """Words that have become known since the last outcome was told."""
        self._new = NewWords()

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case ConnectionEvent():
                self._events[message.id] = message
            case Utterance(final=True):
                self._heard[message.actor, message.id] = HeardText(
                    actor=message.actor, id=message.id, text=message.text, began=message.began, to=message.to
                )
            case _:
                return
        self._tell_decided()

    def expect(self, outcome: FragmentOutcome) -> None:
        """Take the outcome of a fragment, to be told now or when its last event is decided."""
        self._waiting.append(outcome)
        self._tell_decided()

    def finish(self) -> None:
        """Tell the rest as it is now."""
        while self._waiting:
            self._tell(self._waiting.pop(0))

    def _tell_decided(self) -> None:
        while self._waiting and all(map(self._is_over, self._now(self._waiting[0]).events)):
            self._tell(self._waiting.pop(0))

    def _is_over(self, event: ConnectionEvent) -> bool:
        """True once an event is decided, and its words are known if there will be some."""
        return event.state != "started" and not self._words_will_come(event)

    def _now(self, outcome: FragmentOutcome) -> FragmentOutcome:
        return replace(outcome, events=tuple(self._events.get(event.id, event) for event in outcome.events))

    def _tell(self, outcome: FragmentOutcome) -> None:
        now = self._now(outcome)
        heard = self._new.of(({(each.actor, each.id): each for each in outcome.heard} | self._heard).values())
        self._heard.clear()
        result = summary(replace(now, heard=heard))
        self._outputs.outcome(outcome.fragment, result)
        text = f"{outcome.fragment}: {result.text}"
        self._console.print(text, style="bold", markup=False, highlight=False, soft_wrap=True)


class Warnings:
    """Sink that prints and counts warnings. Those of a block wait until it has started: its refusal repeats them."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._begun: set[str] = set()
        self._asked: Counter[str] = Counter()
        """Blocks that were asked for and have not started, by id: how many of that id."""
        self._held: list[WarningFeedback] = []
        self.count = 0

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case WarningFeedback():
                self.count += 1
                self._held.append(message)
            case BlockProgress(progress="start", block=str() as block):
                self._begun.add(block)
                self._asked[block] -= bool(self._asked[block])
        self._print(lambda block: block in self._begun and not self._asked[block])

    def ask(self, block: str) -> None:
        """Hold warnings of this id from now on: they may be about a block that is refused."""
        self._asked[block] += 1

    def refused(self, block: str) -> None:
        """Drop the waiting warnings of a block, as its refusal has told them.

        If another one of that id is performed, what is about behaviors is that one's.
        """
        self._asked[block] -= 1
        is_alone = block not in self._begun and not self._asked[block]
        self._held = [each for each in self._held if each.block != block or (each.behavior and not is_alone)]

    def finish(self) -> None:
        """Print the waiting warnings."""
        self._print(lambda block: True)

    def _print(self, is_told: Callable[[str], bool]) -> None:
        """Print the warnings of these blocks, and those of none."""
        told = [each for each in self._held if not each.block or is_told(each.block)]
        self._held = [each for each in self._held if each not in told]
        for each in told:
            self._console.print(wording.warning(each), markup=False, highlight=False, soft_wrap=True)
