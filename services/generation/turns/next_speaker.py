"""The policy of the next speaker: to whom of several the robot gives the turn. Pure.

Who ends a turn to several people chooses by a name, or by a look, who is to speak next, if anybody is chosen (Sacks,
Schegloff and Jefferson 1974). So the one called in the robot's last sentence gets the look at the end of the turn. If
nobody is named it is the one who has been silent for longest: a robot whose eyes seek the least active person evens
out who takes part (Gillet et al. 2021), and one that looks at the same person after each question does the opposite.
"""

import re
from collections.abc import Callable

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.perception import ActionEnded
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.generation.turns.policy import News, TurnPolicy, TurnScene
from engage_hri.services.text.calling import called

_SENTENCE_END = re.compile(r"(?<=[.!?…。！？])\s*(?=\S)")


class NextSpeakerPolicy(TurnPolicy):
    """Puts the person to whom the turn is given first among its addressees."""

    def __init__(self, name: str, scene: TurnScene, config: GenerationConfig) -> None:
        super().__init__(name, scene, config)
        self._spoke: dict[str, Seconds] = {}
        """When each of those in sight has spoken last."""
        self._names: dict[str, str] = {}
        """What they are called."""

    def feed(self, message: News, now: Seconds) -> None:
        match message:
            case World():
                self._names = {person.id: person.name or person.id for person in message.people}
                self._spoke = {id: at for id, at in self._spoke.items() if id in self._names}
            case ActionEnded(action="speak", actor=actor):
                self._spoke[actor] = now

    def rename(self, name: Callable[[str], str]) -> None:
        self._spoke = {name(id): at for id, at in self._spoke.items()}

    def amended(self, plan: TurnPlan, fragment: TurnFragment) -> TurnPlan:
        if not plan.closes or not plan.others:
            return plan
        last = next((each.text for each in reversed(fragment.behaviors) if isinstance(each, Speech)), "")
        names = {self._names.get(who, who).casefold(): who for who in plan.addressees}
        found = called(_SENTENCE_END.split(last.strip())[-1], names)
        named = [who for who in plan.addressees if who in found] or plan.addressees
        first = min(
            [who for who in plan.addressees if who in named] or plan.addressees,
            key=lambda who: self._spoke.get(who, float("-inf")),
        )
        return replace(plan, addressee=first, others=tuple(who for who in plan.addressees if who != first))
