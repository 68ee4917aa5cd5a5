"""Policies of turns are a list: others add theirs in their place, and can be done without."""

import re
from collections.abc import Callable, Collection, Hashable, Mapping
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.followed import arranged
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.generation.turns.policies import OWN
from engage_hri.services.generation.turns.policy import EarlyEnd, News, TurnPolicy
from engage_hri.services.generation.turns.robot_turns import RobotTurns
from tests.control.test_offers import install as install
from tests.generation.partners import stage
from tests.generation.turns import robot_turns, seen

Install = Callable[..., None]


class AtSix(TurnPolicy):
    """Ends the turn at 6 s, says each fragment to be interruptible by nobody, and waits from 2 s on."""

    before = "leaving"
    AT = 6.0

    def amended(self, plan: TurnPlan, fragment: TurnFragment) -> TurnPlan:
        return replace(plan, interruptible=False)

    @property
    def limits(self) -> Mapping[Hashable, Seconds]:
        return {"six": self.AT} if self.scene.current is not None else {}

    def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
        current = self.scene.current
        return self.ends(current, "it is six") if due and current is not None else None

    @property
    def held(self) -> str:
        return self.scene.current.turn if self.scene.current is not None else ""


class BreaksAtPeople(TurnPolicy):
    def feed(self, message: News, now: Seconds) -> None:
        raise ZeroDivisionError("people")


def with_others(**policies: type[TurnPolicy]) -> RobotTurns:
    turns = RobotTurns("robot", GenerationConfig(), policies)
    turns.accept(TurnFragment(id="a", turn_index=1, turn_status="beginning"), "human")
    turns.fragment_begins("a")
    return turns


def test_a_policy_of_others_amends_holds_and_ends_a_turn() -> None:
    turns = with_others(six=AtSix)

    rest = turns.accept(TurnFragment(id="b", turn_index=1, turn_status="middle", interruptible="*"), "")
    assert rest.interruptible is False
    assert turns.held == "a"
    assert turns.deadline == 6.0
    assert turns.tick(5.9) is None
    ended = turns.tick(6.0)
    assert ended is not None
    assert (ended.turn, ended.fragments, ended.why.reason) == ("a", ("a", "b"), "it is six")
    assert turns.tick(6.0) is None
    assert turns.deadline is None


@pytest.mark.parametrize(("before", "told"), [("leaving", "it is six"), ("silence", "human has left")])
def test_of_two_that_end_a_turn_at_one_instant_the_first_says_why(before: str, told: str) -> None:
    turns = with_others(six=type("Placed", (AtSix,), {"before": before}))
    turns.feed(seen(), 4.0)  # who is out of sight for 2 s has left

    ended = turns.tick(6.0)

    assert ended is not None
    assert ended.why.reason == told
    assert turns.tick(6.0) is None


def test_one_of_others_that_raises_is_dropped_and_noted_and_turns_go_on() -> None:
    turns = with_others(breaks=BreaksAtPeople)
    turns.feed(seen(), 1.0)
    turns.tick(1.0)

    assert [(name, str(error)) for name, error in turns.policies.mistakes] == [("breaks", "people")]
    assert turns.tick(3.0) is not None  # the human has left all the same


@pytest.mark.parametrize("wrong", [lambda self, plan, fragment: 1 / 0, lambda self, plan, fragment: None])
def test_one_of_others_that_cannot_amend_is_dropped_and_the_fragment_is_said(wrong: Callable[..., object]) -> None:
    turns = RobotTurns("robot", GenerationConfig(), {"wrong": type("Wrong", (TurnPolicy,), {"amended": wrong})})

    assert turns.accept(TurnFragment(id="a"), "human").addressee == "human"
    assert [name for name, _ in turns.policies.mistakes] == ["wrong"]


def test_a_limit_that_has_passed_and_ends_nothing_is_due_once() -> None:
    asked: list[list[Hashable]] = []

    class Keeps(TurnPolicy):
        limits = {"six": 6.0}  # noqa: RUF012

        def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
            asked.append([*due])
            return None

    turns = with_others(keeps=Keeps)
    assert turns.deadline == 6.0
    for at in (5.0, 6.0, 6.0, 7.0):
        turns.tick(at)

    assert asked == [[], ["six"], [], []]
    assert turns.deadline is None


@pytest.mark.parametrize("off", OWN)
def test_each_can_be_off(off: str) -> None:
    assert [*arranged(OWN, {}, (off,))] == [name for name in OWN if name != off]


def test_without_silence_a_turn_stays_open() -> None:
    stays = []
    for off in ((), ("silence",)):
        turns = robot_turns(policies_off=off)
        turns.accept(TurnFragment(id="a", turn_index=1, turn_status="beginning"), "human")
        turns.fragment_ended("a", complete=True, now=0.0)
        turns.tick(0.0)
        stays.append(turns.tick(10.0) is None)

    assert stays == [False, True]


def test_the_policy_of_the_page_is_one() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "generation.md").read_text(encoding="utf-8")
    names: dict[str, type] = {}
    exec(re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1], names)
    turns = with_others(bell=names["Bell"])
    for features, ends in (((), False), (("ringing",), True)):
        bell = Entity(id="bell", kind="object", position=(2.0, 1.0, 1.0), features=features)
        world = seen("human")
        turns.feed(replace(world, entities=(*world.entities, bell)), 1.0)

        assert (turns.tick(1.0) is not None) == ends


QUIET = """
from engage_hri import TurnPolicy

class Quiet(TurnPolicy):
    def ending(self, now, due):
        current = self.scene.current
        return self.ends(current, "it is night") if current else None
"""


async def test_a_policy_of_an_installed_package_ends_a_turn(hub: MemoryHub, install: Install) -> None:
    install("acme-night", "[engage.turn_policies]\nquiet = acme_night:Quiet\n", acme_night=QUIET)
    async with stage(hub) as partners:
        outcome = await partners.send(
            TurnFragment(id="a", turn_index=1, turn_status="full", addressee="human")
        ).outcome

        assert isinstance(outcome, FragmentOutcome)
        assert outcome.fault is not None
        assert "it is night" in outcome.fault.reason
