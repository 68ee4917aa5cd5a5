"""Table 3.1, every row and index; turns over streamed fragments; what is illegal; what ends a turn early."""

from typing import Any

import pytest

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from engage_hri.services.generation.turns.plan import TurnPlan, in_vain, plan_turn
from engage_hri.services.generation.turns.robot_turns import Aborted, RobotTurns
from tests.generation.turns import robot_turns


def told(aborted: Aborted | None) -> tuple[str, str, tuple[str, ...], str]:
    """A turn that was aborted, and why."""
    assert aborted is not None
    return (aborted.turn, aborted.addressee, aborted.fragments, aborted.why.reason)


def fragment(id: str, status: TurnStatus, index: int = 1, **fields: object) -> TurnFragment:
    return TurnFragment(id=id, turn_index=index, turn_status=status, **fields)  # type: ignore[arg-type]


def policy() -> RobotTurns:
    return robot_turns()


@pytest.mark.parametrize(
    ("status", "index", "pair", "reply", "closes", "backchannel"),
    [
        ("beginning", 1, True, "", False, False),
        ("beginning", 2, False, "answered", False, False),
        ("beginning", 3, False, "repaired", False, False),
        ("middle", 1, False, "", False, False),
        ("middle", 2, False, "", False, False),
        ("middle", 3, False, "", False, False),
        ("end", 1, False, "", True, False),
        ("end", 2, False, "", True, False),
        ("end", 3, False, "", True, False),
        ("full", 1, True, "", True, False),
        ("full", 2, False, "answered", True, False),
        ("full", 3, False, "repaired", True, False),
        ("backchannel", 1, False, "", False, True),
        ("backchannel", 2, False, "", False, True),
        ("backchannel", 3, False, "", False, True),
    ],
)
def test_table_3_1(status: TurnStatus, index: int, pair: bool, reply: str, closes: bool, backchannel: bool) -> None:
    plan = plan_turn(fragment("f", status, index), "t", "human")

    assert plan == TurnPlan(
        turn="t",
        addressee="human",
        announces_pair=pair,
        reply=reply,  # type: ignore[arg-type]
        closes=closes,
        backchannel=backchannel,
    )


def test_streamed_fragments_are_one_turn_named_after_the_first() -> None:
    turns = policy()

    plans = [
        turns.accept(fragment(id, status), "human")  # type: ignore[arg-type]
        for id, status in [("a", "beginning"), ("b", "middle"), ("c", "end"), ("d", "full")]
    ]

    assert [plan.turn for plan in plans] == ["a", "a", "a", "d"]


@pytest.mark.parametrize(
    ("before", "illegal", "reason"),
    [
        ([], ("x", "middle"), "no turn open"),
        ([], ("x", "end"), "no turn open"),
        ([("a", "full")], ("x", "middle"), "no turn open"),
        ([("a", "beginning")], ("x", "beginning"), "turn a is open"),
        ([("a", "beginning")], ("x", "full"), "turn a is open"),
        ([("a", "beginning")], ("x", "backchannel"), "holds the turn"),
        ([("a", "full")], ("x", "backchannel"), "holds the turn"),
        ([("a", "beginning")], ("a", "middle"), "id"),
    ],
)
def test_an_illegal_sequence_is_refused_and_changes_nothing(
    before: list[tuple[str, TurnStatus]], illegal: tuple[str, TurnStatus], reason: str
) -> None:
    turns = policy()
    for id, status in before:
        turns.accept(fragment(id, status), "human")
    was_open = turns.open_turn

    with pytest.raises(InputRefused, match=reason):
        turns.accept(fragment(*illegal), "human")

    assert turns.open_turn == was_open


@pytest.mark.parametrize("status", ["middle", "end"])
def test_nobody_goes_on_with_a_turn_of_another_client(status: TurnStatus) -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "alice", "v")

    with pytest.raises(InputRefused, match="turn a is spoken by v, not by w"):
        turns.accept(fragment("b", status), "alice", "w")
    assert turns.accept(fragment("c", "end"), "alice", "v").turn == "a"


@pytest.mark.parametrize(
    ("requester", "life", "ends"),
    [
        ("v", "@run2.1", True),
        ("v", "@run1.1", False),
        ("v", "@run1.2", False),
        ("v", "of another program", False),
        ("w", "@run2.1", False),
    ],
)
def test_a_client_that_was_restarted_finds_no_turn_of_its_own_open(requester: str, life: str, ends: bool) -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "alice", "v", "@run1.1")
    turns.fragment_ended("a", complete=True, now=1.0)

    ended = turns.begins_again(requester, life)

    assert (turns.open_turn == "") == ends
    assert (ended.why if ended else None) == (
        Fault(reason="v was restarted", cause="restarted", whose="v") if ends else None
    )
    if ends:
        with pytest.raises(InputRefused, match="'end' with no turn open any more: v was restarted"):
            turns.accept(fragment("b", "end"), "alice", "v", life)
        assert turns.accept(fragment("c", "full"), "alice", "v", life).turn == "c"


def test_a_turn_cannot_change_whom_it_speaks_to() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "alice")

    with pytest.raises(InputRefused, match="speaks to alice, not to bob"):
        turns.accept(fragment("b", "end"), "bob")


def test_the_rest_of_a_turn_speaks_to_whom_it_began_with() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "alice")

    assert turns.accept(fragment("b", "middle"), "").addressee == "alice"
    assert turns.accept(fragment("c", "end"), "alice").addressee == "alice"


def test_what_is_illegal_is_named_by_its_json_path() -> None:
    with pytest.raises(InputRefused) as refusal:
        policy().accept(fragment("a", "middle"), "human")

    assert refusal.value.fault.where == "a: $.turn_status"


def test_a_backchannel_is_fine_once_the_turn_is_over() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    turns.fragment_ended("a", complete=True, now=1.0)

    assert turns.accept(fragment("b", "backchannel"), "human").backchannel


def test_silence_closes_an_open_turn_after_ten_seconds() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    assert turns.deadline is None  # as long as it is performed
    turns.fragment_ended("a", complete=True, now=3.0)
    assert turns.deadline == 13.0

    assert turns.tick(12.9) is None
    assert told(turns.tick(13.0)) == ("a", "human", (), "silence for 10 s")
    assert turns.deadline is None
    assert turns.accept(fragment("b", "beginning"), "human").turn == "b"


def test_the_next_fragment_ends_the_silence() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_ended("a", complete=True, now=3.0)
    turns.accept(fragment("b", "middle"), "human")

    assert turns.deadline is None
    assert turns.tick(20.0) is None


def test_a_failed_fragment_aborts_its_turn_and_what_is_in_line() -> None:
    turns = policy()
    for id, status in [("a", "beginning"), ("b", "middle"), ("c", "end"), ("d", "full")]:
        turns.accept(fragment(id, status), "human")  # type: ignore[arg-type]

    aborted = turns.fragment_ended("a", complete=False, now=1.0, why=Fault(reason="a failed"))

    assert told(aborted) == ("a", "human", ("b", "c"), "a failed")
    assert turns.fragment_ended("b", complete=False, now=1.0) is None  # ended already
    assert turns.holds_the_turn  # with d


def test_recognition_is_not_told_of_a_turn_that_has_the_id_of_one_that_failed_and_has_not_begun() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    turns.fragment_begins("a")
    failed = turns.fragment_ended("a", complete=False, now=1.0)
    turns.accept(fragment("a", "full"), "human")
    again = turns.fragment_ended("a", complete=False, now=2.0)

    assert failed is not None
    assert again is not None
    assert (failed.is_known, again.is_known) == (True, False)


def test_after_a_fault_the_turn_cannot_go_on() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_ended("a", complete=False, now=1.0)

    with pytest.raises(InputRefused, match="no turn open"):
        turns.accept(fragment("b", "end"), "human")


def test_the_robot_thinks_only_within_an_open_turn_with_nothing_in_line() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning", delay=True, delay_target="table"), "human")
    meanwhile = turns.averted_to
    turns.fragment_ended("a", complete=True, now=1.0)
    assert (meanwhile, turns.averted_to) == ("", "table")

    turns.accept(fragment("b", "end", delay=True, delay_target="table"), "human")
    assert turns.averted_to == ""
    turns.fragment_ended("b", complete=True, now=2.0)
    assert turns.averted_to == ""


def test_it_is_the_last_fragment_that_asks_for_time_to_think_whichever_ends_last() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.accept(fragment("b", "middle", delay=True, delay_target="table"), "human")
    turns.fragment_ended("b", complete=True, now=1.0)
    still_busy = turns.averted_to
    turns.fragment_ended("a", complete=True, now=2.0)

    assert (still_busy, turns.averted_to) == ("", "table")


def test_a_fragment_without_delay_ends_the_thinking() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning", delay=True, delay_target="table"), "human")
    turns.accept(fragment("b", "middle"), "human")
    for id in ("a", "b"):
        turns.fragment_ended(id, complete=True, now=1.0)

    assert turns.averted_to == ""


# -- illegal, adversarial -----------------------------------------------------------------------------------------

STATUSES: tuple[TurnStatus, ...] = ("beginning", "middle", "end", "full", "backchannel")
LEGAL = {"silent": {"beginning", "full", "backchannel"}, "open": {"middle", "end"}, "speaking": {"beginning", "full"}}
"""What may come: with no turn; within an open one; while the last fragment of a turn is performed."""


@pytest.mark.parametrize("index", [1, 2, 3])
@pytest.mark.parametrize("status", STATUSES)
@pytest.mark.parametrize("state", LEGAL)
def test_every_status_and_index_in_every_state(state: str, status: TurnStatus, index: int) -> None:
    turns = policy()
    if state != "silent":
        turns.accept(fragment("a", "beginning" if state == "open" else "full"), "human")

    if status in LEGAL[state]:
        plan = turns.accept(fragment("x", status, index), "human")
        assert (plan.turn, plan.closes, plan.backchannel) == (
            "a" if state == "open" else "x",
            status in ("end", "full"),
            status == "backchannel",
        )
        assert plan.announces_pair is (index == 1 and status in ("beginning", "full"))
    else:
        with pytest.raises(InputRefused):
            turns.accept(fragment("x", status, index), "human")


def test_an_open_turn_stays_open_when_all_that_came_is_performed() -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_ended("a", complete=True, now=1.0)

    with pytest.raises(InputRefused, match="holds the turn"):
        turns.accept(fragment("b", "backchannel"), "human")
    assert turns.accept(fragment("c", "middle"), "human").turn == "a"


def test_a_backchannel_may_come_once_the_end_of_the_turn_is_signalled() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "human")
    turns.fragment_begins("a")
    turns.turn_ended("a", 1.0)

    assert turns.accept(fragment("b", "backchannel"), "human").backchannel
    assert turns.accept(fragment("c", "full"), "human").turn == "c"


def test_backchannels_may_follow_one_another() -> None:
    turns = policy()

    assert [turns.accept(fragment(id, "backchannel"), "human").turn for id in "ab"] == ["a", "b"]


@pytest.mark.parametrize("id", ["a", "b"])
def test_the_id_of_a_turn_that_goes_on_is_taken(id: str) -> None:
    turns = policy()
    turns.accept(fragment("a", "beginning"), "human")
    turns.fragment_ended("a", complete=True, now=1.0)
    turns.accept(fragment("b", "middle"), "human")

    with pytest.raises(InputRefused, match="give every fragment its own id"):
        turns.accept(fragment(id, "end"), "human")


def test_a_turn_may_speak_to_another_person_than_the_one_before() -> None:
    turns = policy()
    turns.accept(fragment("a", "full"), "alice")

    assert turns.accept(fragment("b", "full"), "bob").addressee == "bob"


@pytest.mark.parametrize(
    ("fields", "warning"),
    [
        ({"turn_status": "middle", "delay_target": "table"}, "delayTarget without delay"),
        ({"turn_status": "end", "delay": True, "delay_target": "table"}, "after 'end' there is no turn to hold"),
        ({"turn_status": "middle", "delay": True}, "no surface to look at"),
        ({"turn_status": "middle", "delay": True, "delay_target": "table"}, ""),
        ({"turn_status": "end"}, ""),
    ],
)
def test_a_delay_that_holds_nothing_is_warned_of(fields: dict[str, Any], warning: str) -> None:
    fragment = TurnFragment(id="f", **fields)
    told = tuple(in_vain(fragment, plan_turn(fragment, "f", "ann")))

    assert [warning in text for text in told] == [True] * bool(warning)
