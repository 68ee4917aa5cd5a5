"""Reasons for which a turn of the robot ends early: its addressees leave, its speaker is silent, somebody interrupts.

Whether somebody who speaks into the turn interrupts it recognition decides alone. Until it has, the robot waits.
"""

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActionEnded, Utterance
from engage_hri.schemas.recognition import Interjection
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.interjections import UNDECIDED
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.generation.turns.policy import EarlyEnd, News, TurnPolicy, TurnScene
from engage_hri.services.reports.action_reports import FACE_GRACE
from engage_hri.services.text.listening import is_listening, says_words

TURN_SILENCE: Seconds = 10.0
"""Silence after which an open turn closes as aborted. Recognition waits for its end for longer. Ours."""


class LeavingPolicy(TurnPolicy):
    """Ends a turn all of whose addressees are out of sight. Of a turn to several people one has to stay."""

    def __init__(self, name: str, scene: TurnScene, config: GenerationConfig) -> None:
        super().__init__(name, scene, config)
        self._away: dict[str, Seconds] = {}
        """People who are out of sight, and since when."""

    def feed(self, message: News, now: Seconds) -> None:
        if isinstance(message, World):
            here = {person.id for person in message.people}
            away = {actor for plan in self.scene.under_way for actor in plan.addressees} - here
            self._away = {actor: self._away.get(actor, now) for actor in away}

    @property
    def _left_alone(self) -> Iterator[tuple[str, TurnPlan]]:
        """Turns all of whose addressees are out of sight, each with the one that was there last."""
        for plan in self.scene.under_way:
            if self._away.keys() >= {*plan.addressees}:
                yield max(plan.addressees, key=lambda each: self._away[each]), plan

    @property
    def limits(self) -> Mapping[Hashable, Seconds]:
        return {who: self._away[who] + FACE_GRACE for who, _ in self._left_alone}

    def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
        for last, plan in self._left_alone:
            if last in due:
                why = self.scene.sight.fault(f"{last} has left", "", "gone", last, "", self._away[last])
                return EarlyEnd(plan, why)
        return None

    def rename(self, name: Callable[[str], str]) -> None:
        self._away = {name(id): since for id, since in self._away.items()}


class SilencePolicy(TurnPolicy):
    """Ends the open turn once its speaker has sent nothing for long."""

    @property
    def limits(self) -> Mapping[Hashable, Seconds]:
        since, turn = self.scene.silent_since, self.scene.open
        return {turn.turn: since + TURN_SILENCE} if since is not None and turn is not None else {}

    def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
        since, turn = self.scene.silent_since, self.scene.open
        if not due or since is None or turn is None:
            return None
        silence, speaker = f"silence for {TURN_SILENCE:g} s", self.scene.speaker
        return EarlyEnd(turn, self.scene.sight.fault(silence, "", "late", speaker, "", since))


class InterruptionPolicy(TurnPolicy):
    """Ends the turn that somebody interrupts, and holds it while that is undecided."""

    def __init__(self, name: str, scene: TurnScene, config: GenerationConfig) -> None:
        super().__init__(name, scene, config)
        self._into = scene.interjections
        self._taken_by: dict[str, str] = {}
        """Turns in which somebody has taken the floor, and who."""

    def feed(self, message: News, now: Seconds) -> None:
        match message:
            case Interjection():
                self._interject(message, now)
            case ActionEnded(action="speak", actor=actor):
                self._into.falls_silent(actor)
            case Utterance(final=True, actor=actor, text=text) if says_words(text) and not is_listening(text):
                # By words a voice without any may turn out to interrupt, or one that nobody decides.
                self._into.hear(actor, text)
                if self._into.decide_wordless(actor, now, has_words=True):
                    self._takes_floor(actor)

    def _interject(self, told: Interjection, now: Seconds) -> None:
        current = self.scene.current
        if current is None or current.turn not in self.scene.begun:
            self._into.feed(told, "", now, after=None)
        elif self._into.feed(told, current.turn, now, after=current.gives_way_after(told.actor)):
            self._takes_floor(told.actor)

    def _takes_floor(self, actor: str) -> None:
        if self.scene.current is not None:
            self._taken_by = {self.scene.current.turn: actor}

    @property
    def held(self) -> str:
        current = self.scene.current
        return current.turn if current is not None and self._into.waits_in(current.turn) else ""

    @property
    def limits(self) -> Mapping[Hashable, Seconds]:
        turn = self.scene.current.turn if self.scene.current is not None else ""
        limits: dict[Hashable, Seconds] = {
            ("undecided", actor): opened + UNDECIDED for actor, opened in self._into.waits_in(turn).items()
        }
        limits |= {("counts", actor): at for actor, at in self._into.unheeded_in(turn).items()}
        limits |= {("lasts", actor): at for actor, at in self._into.wordless_in(turn).items()}
        if (barge_in := self.config.barge_in) is not None:
            voiced = self._into.voiced_in(turn)
            limits |= {("talks", actor): opened + barge_in for actor, opened in voiced.items()}
        return limits

    def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
        for each in due:
            assert isinstance(each, tuple)
            what, who = each
            if self._decide(what, who, now):
                self._takes_floor(who)
        taken, self._taken_by = self._taken_by, {}
        current = self.scene.current
        if current is None or (actor := taken.get(current.turn)) is None:
            return None
        return EarlyEnd(current, Fault(reason=f"{actor} took the floor", cause="cancelled", whose=actor))

    def _decide(self, what: str, who: str, now: Seconds) -> bool:
        """Decide what nobody has decided in time. True: this person takes the floor."""
        match what:
            case "undecided":
                return self._into.give_up(who, now)
            case "counts":
                return self._into.heed(who, now)
            case "lasts":
                return self._into.decide_wordless(who, now, has_words=False)
        return True
