"""A party that talks with the robot most of the time, and what its head did while somebody spoke to it.

In a usual session a dozen speeches are to the robot, some 15 s: too few for a share. Here half of all turns are. To
whom each speech is tells the party, which knows, and not recognition.

python -m tests.study.spoken_to --seeds 4 --from 1701 --people 3 [--set generation.policies_off='["aversion"]']
"""

import argparse
import random
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial, reduce
from operator import add
from typing import NamedTuple

from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.messages import Message
from engage_hri.services.bus.interface import Bus
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.simulation.party import NAMES, Party, PartyHabits, Saying
from engage_hri.services.simulation.still import show_company
from engage_hri.services.tangram.people.service import table_with
from tests.study.head_sessions import played, settings_of
from tests.study.robot_head import Span, moments, seconds, spans

HABITS = PartyHabits(addresses_robot=0.7, replies=0.4)
REACTION = 0.2
"""Time in which nobody looks at who has begun to speak: people react after 0.2 to 0.4 s."""
ELSE = {
    "fragment": "its own turn", "aversion": "a look away", "response": "another one who looks", "face": "another one",
}  # fmt: skip
"""What has the head, by the kind of its claim."""


class AtSpeakers(NamedTuple):
    """Seconds in which somebody spoke to the robot, and where its eyes were. Can be added."""

    speeches: int
    heard: float
    on_face: float
    elsewhere: Counter[str]
    """Seconds in which they were on nobody who spoke to it, by what had the head."""

    def __add__(self, other: "AtSpeakers") -> "AtSpeakers":  # type: ignore[override]
        return AtSpeakers(*(one + another for one, another in zip(self, other, strict=True)))  # type: ignore[operator]

    @property
    def share(self) -> float:
        return self.on_face / self.heard

    def told(self) -> str:
        causes = ", ".join(f"{cause} {lasted / self.heard:.1%}" for cause, lasted in self.elsewhere.most_common())
        return f"{self.speeches} speeches, {self.heard:.0f} s: on who speaks {self.share:.1%}; else {causes}"


def session(seed: int, people: int, settings: tuple[str, ...] = ()) -> tuple[list[Message], list[Saying]]:
    """Play one: all that was on the bus, and all that was said. May be called where no loop runs."""
    config = read(Config, settings=(*settings_of(seed, people), *settings))
    party = Party(NAMES[:people], random.Random(seed), config.robot, "party", habits=HABITS)
    return run_virtual(played(config, simulation=partial(_talks, party=party))), party.said


async def _talks(bus: Bus, ready: Ready, party: Party) -> None:
    party.begin(bus.now())
    await show_company(bus, ready, table_with(party.people), party)


def at_speakers(messages: list[Message], said: Sequence[Saying], robot: str = "robot") -> AtSpeakers:
    """Find where the eyes were while somebody said something to the robot, but for a listener's signs."""
    looks = spans(messages, robot, "look")
    ends = max(each.ended for each in looks)
    to_robot = [
        Span(each.began, each.ended, each.actor)
        for each in said
        if each.to == robot and each.kind in ("talk", "answer") and each.ended <= ends
    ]
    all_said = [Span(each.began, each.ended, each.actor) for each in said]
    owners = _owners(messages, ends)
    on_face, elsewhere = 0.0, Counter[str]()
    for moment, who in moments(to_robot, looks):
        if moment.what in who:
            on_face += moment.length
            continue
        began = min(each.began for each in to_robot if each.what in who and seconds(moment, each))
        for owner, claim in owners:
            part = Span(max(moment.began, owner.began), min(moment.ended, owner.ended))
            if part.length <= 0:
                continue
            if claim.target in who:
                elsewhere["the way of the head"] += part.length
                continue
            elsewhere["reaction"] += (early := seconds(part, Span(began, began + REACTION)))
            speaks = any(each.what == claim.target and seconds(part, each) for each in all_said)
            elsewhere["another one who speaks" if speaks else ELSE.get(claim.kind, claim.kind)] += part.length - early
    return AtSpeakers(len(to_robot), on_face + sum(elsewhere.values()), on_face, elsewhere)


def _owners(messages: Iterable[Message], ends: float) -> list[tuple[Span, Claim]]:
    """The claims that had the head, and when."""
    told = [(each.since.seconds, each.owner) for each in messages if isinstance(each, HeadOwner)]
    begins = [*(at for at, _ in told[1:]), ends]
    return [(Span(at, until), claim) for (at, claim), until in zip(told, begins, strict=True)]


def sum_of(found: Iterable[AtSpeakers]) -> AtSpeakers:
    return reduce(add, found)


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=4)
    options.add_argument("--from", type=int, default=1701, dest="first")
    options.add_argument("--people", type=int, default=3)
    options.add_argument("--set", action="append", default=[], dest="settings")
    given = options.parse_args()
    found = []
    for seed in range(given.first, given.first + given.seeds):
        found.append(at_speakers(*session(seed, given.people, tuple(given.settings))))
        print(seed, found[-1].told(), flush=True)
    print("all", sum_of(found).told())


if __name__ == "__main__":
    main()
