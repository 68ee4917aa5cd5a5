"""Policies of the head are a list: others add theirs in their place, and can be done without."""

import asyncio
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.followed import arranged
from engage_hri.services.generation.head.arbiter import Arbiter
from engage_hri.services.generation.head.maintenance_policy import FaceWatch
from engage_hri.services.generation.head.policies import ORDERS, OWN
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import Observation
from engage_hri.services.generation.policies import installed
from tests.control.test_offers import install as install
from tests.generation.heads import INHIBITED, Stage, on_the_face, world
from tests.generation.partners import stage

Install = Callable[..., None]
SIX = "inhibition", "fragment", "glance", "response", "hands", "face"
"""Claims of thesis 3.3.4, the strongest first."""


class Piece(HeadPolicy):
    """Claims the piece from 20 s to 25 s."""

    before = "glance"
    FROM, TO = 20.0, 25.0
    deadline = FROM

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        self.deadline = self.FROM if now < self.FROM else self.TO  # it says this for ever, also when it has passed
        return self.wish("piece", "its time") if self.FROM <= now < self.TO else None


class FacesElsewhere(FaceWatch):
    """Stands for ours, by its name."""

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        return self.wish("other", "shy")


class Breaks(HeadPolicy):
    def __init__(self, *given: object) -> None:
        super().__init__(*given)  # type: ignore[arg-type]
        self.calls = 0

    def feed(self, message: Observation, now: Seconds) -> None:
        self.calls += 1
        if self.calls == 2:
            raise ZeroDivisionError("a second message")


def staged(**policies: type[HeadPolicy]) -> Stage:
    with_others = Stage()
    with_others.arbiter = Arbiter("robot", GenerationConfig(policies_off=("aversion",)), policies)
    with_others.feed(world())
    return with_others


def test_priorities_are_counted_from_the_order_one_for_each_kind() -> None:
    alone = Arbiter("robot", GenerationConfig())

    priorities = {policy.name: policy.priority for policy in alone.policies}
    assert sorted(SIX, key=lambda name: priorities[name]) == [*SIX]
    assert priorities["listening"] == priorities["response"]
    assert {*priorities.values()} == {*range(1, len({policy.kind for policy in alone.policies}) + 1)}


def test_a_policy_of_others_gets_the_head_in_its_place_and_only_then() -> None:
    with_piece = staged(piece=Piece)
    with_piece.until(22.0)
    assert with_piece.owners[-1] == (20.0, "piece", "piece")
    places = {policy.kind: policy.priority for policy in staged().arbiter.policies}
    assert with_piece.rulings[-1].owner.priority == places["glance"]
    waiting = [claim.priority for claim in with_piece.rulings[-1].waiting if claim.kind == "face"]
    assert waiting == [places["face"] + 1]

    with_piece.do(lambda arbiter: arbiter.fragment_gazes("other"))
    assert with_piece.owner == "fragment"
    with_piece.do(lambda arbiter: arbiter.fragment_lets_go())
    with_piece.until(25.1)
    assert with_piece.owner == "piece"  # the head dwells
    with_piece.until(26.0)
    assert with_piece.owner == "face"


def test_a_policy_of_others_may_stand_for_one_of_ours() -> None:
    shy = staged(face=FacesElsewhere)

    assert shy.owners == [(0.0, "face", "other")]


def test_one_that_raises_is_dropped_and_noted_and_the_head_goes_on() -> None:
    breaking = staged(breaks=Breaks, piece=Piece)
    breaking.feed(world(), world())

    assert [(name, str(error)) for name, error in breaking.arbiter.policies.mistakes] == [
        ("breaks", "a second message")
    ]
    breaking.until(21.0)
    assert breaking.owner == "piece"


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        ({"deadline": lambda self: 1.0}, "its deadline is of type method, .*is @property missing"),
        ({"claim": lambda self, now, weaker: "piece"}, "its claim is of type str"),
        ({"sign": lambda self, now: "ann"}, "its sign is of type str"),
    ],
)
def test_one_whose_answer_is_none_is_dropped_and_told(answers: dict[str, Callable[..., object]], told: str) -> None:
    wrong = staged(wrong=type("Wrong", (HeadPolicy,), {**answers}))
    wrong.until(1.0)

    ((name, error),) = wrong.arbiter.policies.mistakes
    assert name == "wrong"
    assert re.match(told, str(error))
    assert wrong.owner == "face"


def test_a_mistake_of_ours_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*given: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(FaceWatch, "claim", fails)
    with pytest.raises(ZeroDivisionError):
        Stage().feed(world())


@pytest.mark.parametrize("off", [name for name in OWN if name not in ORDERS])
def test_each_can_be_off(off: str) -> None:
    assert [*arranged(OWN, {}, (off,))] == [name for name in OWN if name != off]


def test_without_glances_nothing_disturbs_the_hands() -> None:
    seen = []
    for off in ((), ("glance",)):
        still = on_the_face(policies_off=off)  # type: ignore[arg-type]
        still.feed(world(speed=1.0))
        still.until(60.0)
        seen.append("glance" in [kind for _, kind, _ in still.owners])

    assert seen == [True, False]


@pytest.mark.parametrize(("off", "told"), [("glanse", "no policy 'glanse'"), ("fragment", "somebody has ordered")])
def test_what_there_is_not_and_what_is_ordered_cannot_be_off(off: str, told: str) -> None:
    with pytest.raises(InputRefused, match=told):
        installed(GenerationConfig(policies_off=("aversion", off, "silence")))


def test_a_place_before_one_that_there_is_not_is_refused() -> None:
    late = type("Late", (HeadPolicy,), {"before": "hamds"})
    with pytest.raises(InputRefused, match="is to come before 'hamds'") as refused:
        arranged(OWN, {"late": late})

    assert "hands" in refused.value.fault.advice


def test_an_inhibition_is_above_a_policy_of_others() -> None:
    with_piece = staged(piece=Piece)
    with_piece.until(21.0)
    with_piece.do(lambda arbiter: arbiter.inhibit(INHIBITED))

    assert with_piece.owner == "inhibition"


def test_the_policy_of_the_page_is_one() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "generation.md").read_text(encoding="utf-8")
    code, _ = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    names: dict[str, type] = {}
    exec(code, names)
    looks = staged(door=names["Door"])
    seen = world()
    for features, owner in ((("open",), "door"), ((), "face")):
        door = Entity(id="door", kind="object", position=(2.0, 1.0, 1.0), features=features)
        looks.feed(replace(seen, entities=(*seen.entities, door)))
        looks.until(looks.now + 1.0)
        assert looks.owner == owner


DOOR = """
from engage_hri import HeadPolicy

class Middle(HeadPolicy):
    before = "glance"

    def claim(self, now, weaker):
        return self.wish("middle", "always")

class Breaking(HeadPolicy):
    def claim(self, now, weaker):
        raise LookupError("lost")
"""


async def test_a_policy_of_an_installed_package_turns_the_head(hub: MemoryHub, install: Install) -> None:
    install("acme-manners", "[engage.head_policies]\nmiddle = acme_manners:Middle\n", acme_manners=DOOR)
    async with stage(hub) as partners:
        await asyncio.sleep(0.1)

        assert [(each.owner.kind, each.owner.target) for each in partners.owners] == [("middle", "middle")]


@pytest.mark.contained
async def test_one_that_breaks_is_a_fault_and_the_robot_looks_at_people_all_the_same(
    hub: MemoryHub, install: Install
) -> None:
    install("acme-manners", "[engage.head_policies]\nlost = acme_manners:Breaking\n", acme_manners=DOOR)
    async with stage(hub) as partners:
        await asyncio.sleep(0.1)

        assert [(each.owner.kind, each.owner.target) for each in partners.owners] == [("face", "human")]
        assert any("policy 'lost'" in str(each) for each in partners.faults)
