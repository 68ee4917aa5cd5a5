"""Tests of the audit of requests: it notices every mistake that it is there for."""

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted, Refused
from tests.rigs.hostile.audit import Audit

KEY = keys.command(keys.BLOCK, "manager", "ann")
ASK = PerformBlock(id="1", life="a", block=Block(id="b"))
DONE = BlockOutcome(id="1", requester="ann", life="a", kind="perform_block", block="b", status="done")
REFUSED = Refused(id="1", requester="ann", life="a", kind="perform_block", fault=Fault(reason="no"))


def audited(*told: tuple[str, Message, str]) -> Audit:
    made = Audit()
    for now, (key, message, sender) in enumerate(told):
        made.hear(key, message, sender, "", float(now), arrives=True, is_foreign=False)
    return made


def test_a_request_that_was_not_answered_is_open() -> None:
    accepted = Accepted(id="1", requester="ann", life="a", kind="perform_block")
    state = keys.request_state("realizer")

    assert [entry.name.id for entry in audited((KEY, ASK, "ann"), (state, accepted, "realizer")).open] == ["1"]
    assert audited((KEY, ASK, "ann"), (state, DONE, "realizer")).open == []


def test_what_a_server_owed_in_its_former_life_it_does_not_owe_now() -> None:
    made = audited((KEY, ASK, "ann"))
    made.note_restart("realizer")

    assert made.open == []


def test_two_different_ends_are_noticed_and_a_repetition_is_none() -> None:
    state = keys.request_state("realizer")

    assert audited((KEY, ASK, "ann"), (state, DONE, "realizer"), (state, DONE, "realizer")).doubled == []
    assert len(audited((KEY, ASK, "ann"), (state, DONE, "realizer"), (state, REFUSED, "realizer")).doubled) == 1


def test_an_answer_of_somebody_else_counts_for_nothing() -> None:
    state = keys.request_state("realizer")

    assert len(audited((KEY, ASK, "ann"), (state, DONE, "mallory")).open) == 1


def test_a_requester_that_goes_on_about_what_has_ended_is_noticed() -> None:
    made = audited((KEY, ASK, "ann"), (keys.request_state("realizer"), DONE, "realizer"))
    made.hear(KEY, ASK, "ann", "", 20.0, arrives=True, is_foreign=False)

    assert len(made.lingering(15.0)) == 1
    assert made.lingering(25.0) == []
