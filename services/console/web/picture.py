"""Picture of the whole system, as the page in the browser shows it. Pure: messages and instants in, sections out.

`feed(message, at, now)` takes messages of any source: a running bus, or a recording that is played. `versions` says
which sections there are, and which have changed; `section(name)` gives one as JSON.
"""

from collections import deque
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any

import msgspec
from msgspec.structs import replace

from engage_hri.schemas.blocks import (
    BlockProgress,
    Held,
    NetMarked,
    NetPlanned,
    NetWaiting,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import Capabilities, RobotState
from engage_hri.schemas.body_faults import BodyFaults, words
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, HeadOwner, StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone, ServiceSettings, Status, is_claim
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, SamePeople, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Acquaintances
from engage_hri.services.console import nets, view, wording
from engage_hri.services.console.web import scene
from engage_hri.services.console.web.health import HealthBoard, recognizes
from engage_hri.services.console.web.lanes import BlockLanes, EventLanes, FloorLanes, Measures
from engage_hri.services.console.web.scene import plainly
from engage_hri.services.console.web.sections import Choice, HeadSection, Note, Switched, UtteranceShown
from engage_hri.services.console.web.turns import ShownTurns

CHOICES_KEPT = 40
NOTES_KEPT = 40
BLOCK, NET, MEASURES = "block/", "net/", "measures/"
"""Beginnings of the names of sections that each block, net and person has for itself, as `block/step-3`."""
SETTLED_EVERY: Seconds = 1.0
"""Longest time, while messages come, until what is over is forgotten, whether or not somebody looks."""
SLOWLY: tuple[Seconds, tuple[str, ...]] = (1.0, (MEASURES, "delays"))
"""Sections that are told at most so often: they are large, and nobody sees the difference."""


class Picture:
    """The picture. robot: its actor id. began: the instant that counts as zero."""

    def __init__(self, robot: str, began: Seconds) -> None:
        self.began = began
        self.now = began
        self._scene = view.empty(robot, began)
        self._world: World | None = None
        self._state: RobotState | None = None
        self._body: Capabilities | None = None
        self._head_since = began
        self._floor = FloorLanes()
        self._events = EventLanes()
        self._blocks = BlockLanes()
        self._turns = ShownTurns()
        self._nets: nets.Nets = {}
        self._structures: dict[str, object] = {}
        self._measures = Measures()
        self._people = Acquaintances()
        self.reporters: dict[str, str] = {}
        """Participant that tells of each person."""
        self._numbers = count()
        self._choices: deque[Choice] = deque(maxlen=CHOICES_KEPT)
        self._health = HealthBoard()
        self._understands = False
        self._notes: deque[Note] = deque(maxlen=NOTES_KEPT)
        self._sections: dict[str, Callable[[], Any]] = {
            "scene": lambda: scene.section(self._scene, self._world, self._state, self._body),
            "words": self._words,
            "head": self._head,
            "floor": lambda: self._floor.shown(self.zero),
            "events": lambda: self._events.shown(self.zero),
            "nets": lambda: list(self._nets),
            "tokens": lambda: [nets.tokens(net) for net in self._nets.values()],
            "delays": lambda: self._measures.delays(self.zero),
            "references": lambda: list(self._choices),
            "health": self._health.shown,
            "notes": lambda: list(self._notes),
            "switched": self._switched,
        }
        """Makers of the sections that are always there; `sections.py` has their fields."""
        self.versions = dict.fromkeys(self._sections, 1)
        """Number of the newest state of each section."""
        self._number = 1
        self._encoded: dict[str, tuple[int, bytes]] = {}
        self._settles = began + SETTLED_EVERY
        """Time by which the next message lets time pass: else a window that nobody looks at would keep everything."""
        self._late: dict[str, Seconds] = {}
        """Sections that have changed and are told slowly, and when they may be told."""

    @property
    def world(self) -> World:
        """The world as it was told last; empty before."""
        return self._world or World(entities=())

    @property
    def present(self) -> tuple[str, ...]:
        """Ids of the people who are there, and have a place."""
        gone = {each.id for each in self._scene.actors.values() if not each.present}
        return tuple(each.id for each in self.world.people if each.id not in gone)

    @property
    def body(self) -> Capabilities | None:
        """The body as it described itself; None: not yet."""
        return self._body

    def in_words(self, blocks: Iterable[str]) -> str:
        """Words for what the robot does with these blocks: what it says, or that it moves. Empty without blocks."""
        known = list(blocks)
        told = [
            f"“{words}”" if (words := self._turns.words(id)) else "a movement"
            for id in known
            if not id.startswith(view.OWN_BLOCKS)
        ]
        looks = ["where it looks"] if any(id.startswith(view.OWN_BLOCKS) for id in known) else []
        return ", ".join(dict.fromkeys((*told, *looks)))

    @property
    def understands(self) -> bool:
        """True if who hears people understands words, as its settings say."""
        return self._understands

    def has(self, name: str) -> bool:
        """Tell whether a participant is on the bus."""
        return self._health.has(name)

    def zero(self, at: Seconds) -> Seconds:
        """Seconds of the picture at a local instant."""
        return round(at - self.began, 3)

    # -- what is told ---------------------------------------------------------------------------------------------

    def feed(self, message: Message, at: Seconds, now: Seconds) -> None:
        """Take a message. at: local instant that it tells of. now: local time, which never goes back."""
        self.now = max(self.now, now)
        if self.now >= self._settles:
            self.advance(self.now)
        is_again = isinstance(message, WarningFeedback) and view.is_again(self._scene, message)
        self._see(message, at)
        match message:
            case World():
                self._world = message
                self._people.see([each.id for each in message.people], self.now)
                self._changed("scene")
            case RobotState():
                self._state = message
                self._changed("scene")
            case Capabilities():
                self._body = message
                self._changed("scene")
            case HeadOwner():
                self._head_since = at
                self._changed("head")
            case ConnectionEvent(retold=False):
                self._events.feed(message, at)
                self._changed("events", *(("delays",) if self._measures.feed(message, at) else ()))
            case Statistics(actor=actor):
                self._measures.feed(message, at)
                if actor:
                    self._people.hear(actor, self.now)
                self._changed(f"{MEASURES}{actor}")
            case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
                self._people.hear(message.actor, self.now)
            case SamePeople(people=people):
                for each in people:
                    self._forget(each.actor)
            case BlockProgress() | SyncPointProgress() | PredictionFeedback():
                self._take_block(message, at)
            case NetPlanned() | NetMarked() | NetWaiting():
                self._take_net(message, at)
            case FragmentOutcome():
                self._take_choices(message)
            case PeerAlive() | PeerGone() | Status():
                self._health.feed(message)
                self._changed("health")
                if not isinstance(message, Status):
                    self._take_presence(message, at)
            case ServiceSettings(participant="hearing"):
                self._understands = recognizes(message)
                self._changed("health")
            case Held() | BodyFaults() | StudyCondition():
                self._changed("switched")
        if not is_again:
            self._note(message, at)

    def _see(self, message: Message, at: Seconds) -> None:
        before = self._scene
        self._scene = view.feed(before, message, at)
        if self._scene.owner != before.owner:
            self._head_since = at
            self._changed("head")
        if self._floor.feed(message, at):
            self._changed("floor")
        is_news = self._turns.feed(message, at)
        if is_news or self._scene.said != before.said or self._scene.held != before.held:
            self._changed("words")
        if self._scene.actors != before.actors:
            self._changed("scene")

    def _take_presence(self, message: PeerAlive | PeerGone, at: Seconds) -> None:
        """Take news of who is on the bus: what a participant tells is over without it."""
        self._changed("switched", *(f"{BLOCK}{id}" for id in self._blocks.presence(message, at)))
        if self._measures.presence(message):
            self._changed(*(f"{MEASURES}{person}" for person in self._measures.people))
        if (left := nets.feed(self._nets, message, at, self.now)) is not self._nets:
            self._nets = left
            self._changed("tokens")
        if isinstance(message, PeerGone) and message.participant == "control" and self._state is not None:
            self._state = replace(self._state, speaking="", looking_at="")
            self._changed("scene")

    def _take_net(self, message: NetPlanned | NetMarked | NetWaiting, at: Seconds) -> None:
        if isinstance(message, NetPlanned):
            self._take_block(message, at)
        self._nets = nets.feed(self._nets, message, at, self.now)
        if isinstance(message, NetMarked):
            self._changed("tokens")
        elif (net := self._nets.get(message.block)) is not None:
            self._lay_out(net)

    def _take_block(
        self, message: BlockProgress | SyncPointProgress | PredictionFeedback | NetPlanned, at: Seconds
    ) -> None:
        if id := self._blocks.feed(message, at):
            self._changed(f"{BLOCK}{id}")

    def _lay_out(self, net: nets.NetInView) -> None:
        """Lay out a net, unless its structure is the one that it had."""
        structure = (net.transitions, net.places, net.waits_for, net.began)
        if self._structures.get(net.block) != structure:
            self._structures[net.block] = structure
            self._changed(f"{NET}{net.block}")
        self._changed("nets", "tokens")

    def _take_choices(self, outcome: FragmentOutcome) -> None:
        for made in outcome.choices:
            self._choices.append(
                Choice(
                    number=next(self._numbers), fragment=outcome.fragment,
                    reference=made.reference, target=made.target, gesture=made.gesture,
                    phrase=made.phrase, reliability=made.reliability, cost=made.cost, pairs=made.pairs,
                )
            )  # fmt: skip
        if outcome.choices:
            self._changed("references")

    def _note(self, message: Message, at: Seconds) -> None:
        text, level = "", "warning"
        match message:
            case WarningFeedback():
                text = wording.warning(message).removeprefix("! ")
            case Fault():
                text, level = f"{message.service or 'fault'}: {message}", "fault"
            case PeerGone(participant=name) | PeerAlive(participant=name) if is_claim(name):
                return
            case PeerGone(participant=name):
                text, level = f"{name} has left the bus", "news"
                if name == "generation" and (lost := self._scene.study.missed) is not None:
                    self.note(lost.lost_sentence, at, "warning")
            case PeerAlive(participant=name):
                text, level = f"{name} has come onto the bus", "news"
        if text:
            self.note(text, at, level)

    def note(self, text: str, at: Seconds, level: str = "news") -> None:
        """Add a note that no message tells. level: fault, warning or news."""
        self._notes.append(Note(self.zero(at), level, text))
        self._changed("notes")

    def note_reporter(self, person: str, name: str, now: Seconds) -> None:
        """Note which participant tells of a person."""
        self._people.hear(person, now)
        self.reporters[person] = name

    def silence(self, names: frozenset[str], now: Seconds) -> None:
        """Say which participants have not answered a question for their status."""
        self.now = max(self.now, now)
        if self._health.silence(names):
            self._changed("health")

    # -- what is shown --------------------------------------------------------------------------------------------

    def _forget(self, person: str) -> None:
        self._measures.forget(person)
        self.reporters.pop(person, None)
        self._drop(f"{MEASURES}{person}")

    def advance(self, now: Seconds) -> None:
        """Let time pass: forget what is over, and tell what is told slowly."""
        self.now = max(self.now, now)
        self._settles = self.now + SETTLED_EVERY
        for person in self._people.forgotten(self.now):
            self._forget(person)
        for id in self._blocks.forget(now):
            self._drop(f"{BLOCK}{id}")
        left = self._latest_shown(nets.without_old(self._nets, now))
        if left.keys() != self._nets.keys():
            for block in self._nets.keys() - left.keys():
                self._structures.pop(block, None)
                self._drop(f"{NET}{block}")
            self._nets = left
            self._changed("nets", "tokens")
        for name in [name for name, due in self._late.items() if now >= due]:
            del self._late[name]
            self._number += 1
            self.versions[name] = self._number

    def _latest_shown(self, left: nets.Nets) -> nets.Nets:
        """The nets that are left, and the newest that is not of a mere look: it stays, to be studied."""
        others = [net for net in self._nets.values() if not net.block.startswith(view.OWN_BLOCKS)]
        if not others or others[-1].block in left:
            return left
        last = others[-1]
        return {last.block: last if last.is_over else replace(last, is_over=True), **left}

    def section(self, name: str) -> bytes:
        """A section as JSON. It is made once for each version."""
        version = self.versions[name]
        known = self._encoded.get(name)
        if known is None or known[0] != version:
            known = self._encoded[name] = (version, msgspec.json.encode(self.made(name)))
        return known[1]

    def made(self, name: str) -> Any:
        """A section; `sections.py` has its fields."""
        if name.startswith(BLOCK):
            return self._blocks.shown(name.removeprefix(BLOCK), self.zero)
        if name.startswith(NET):
            return nets.laid_out(self._nets[name.removeprefix(NET)], self.zero)
        if name.startswith(MEASURES):
            return self._measures.shown(name.removeprefix(MEASURES), self.zero)
        return self._sections[name]()

    def _words(self) -> list[UtteranceShown]:
        holds = [each.hold for each in self._scene.held]
        return self._turns.shown(self._scene.said, holds, self.zero)

    def _head(self) -> HeadSection:
        owner = self._scene.owner
        waiting = tuple(plainly(claim, self.world) for claim in self._scene.waiting)
        return HeadSection(
            None if owner is None else plainly(owner, self.world), self.zero(self._head_since), waiting
        )

    def _switched(self) -> Switched:
        held = tuple(wording.held(each.hold) for each in self._scene.held)
        kinds = dict.fromkeys(each.kind for each in self._scene.faults)
        by = self._scene.faults_by if kinds else ""
        if by and not self._health.has(by):
            by += ", which has left the bus"
        return Switched(
            held, tuple(map(words, self._scene.faults)), tuple(kinds), by,
            condition=self._condition(),
        )  # fmt: skip

    def _condition(self) -> str:
        """The condition of a study in words, or that it is lost; empty: nobody has set one."""
        told, lost = self._scene.study.told, self._scene.study.missed
        if lost is not None:
            return lost.lost_sentence
        return told.sentence if told is not None and told.is_told else ""

    def _changed(self, *names: str) -> None:
        pause, slow = SLOWLY
        for name in names:
            if name.startswith(slow):
                self._late.setdefault(name, self.now + pause)
                continue
            self._number += 1
            self.versions[name] = self._number

    def _drop(self, name: str) -> None:
        self._late.pop(name, None)
        self.versions.pop(name, None)
        self._encoded.pop(name, None)
