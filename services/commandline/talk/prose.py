"""Result of each fragment as a line of prose, once its connection events are decided; and warnings."""

from collections import Counter
from collections.abc import Callable

from msgspec.structs import replace
from rich.console import Console

from engage_hri.schemas.blocks import BlockProgress, WarningFeedback
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, HeardText
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import summary
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.robot import NewWords
from engage_hri.services.commandline.shell.outputs import Outputs
from engage_hri.services.console import wording


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


def strict_refusal(warnings: int) -> InputRefused:
    """Error with which `--strict` fails."""
    return InputRefused(Fault(reason=f"{warnings} warning{'s' * (warnings > 1)}; --strict allows none"))
