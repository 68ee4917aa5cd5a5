"""Holders of keys: their names, the marks of their processes, and what a process may have sent."""

import pytest
import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import Does, Holder, may_have_sent
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.zenoh.rights import Rights


def run_of(role: str, name: str) -> str:
    return f"{Holder(robot='robot', role=role, name=name).mark}{'0123456789ab' * 2}"


def test_marks_tell_roles_apart_and_begin_an_id_of_zenoh() -> None:
    marks = {Holder(robot="r", role=role, name="x").mark for role in access.ROLES}
    assert len({mark[:4] for mark in marks}) == len(access.ROLES)
    for mark in marks:
        config = zenoh.Config()
        config.insert_json5("id", f'"{mark}{"0" * 24}"')
        assert len(mark) == 8


@pytest.mark.parametrize(
    ("role", "name", "key", "expected"),
    [
        ("control", "control", keys.SYNC_POINT, True),
        ("realizer", "realizer", keys.SYNC_POINT, False),
        ("manager", "control", keys.SYNC_POINT, False),
        ("perception", "camera", keys.WORLD, True),
        ("wizard", "wizard", keys.PERCEIVED_ACTION, True),
        ("wizard", "wizard", keys.WORLD, True),
        ("wizard", "wizard", keys.ROBOT_STATE, False),
        ("manager", "alice", keys.command(keys.FRAGMENT, "manager", "alice"), True),
        ("manager", "alice", keys.command(keys.FRAGMENT, "manager", "alice-play-1"), True),
        ("manager", "alice", keys.command(keys.FRAGMENT, "manager", "alicia"), False),
        ("manager", "bob", keys.command(keys.FRAGMENT, "manager", "alice"), False),
        ("manager", "alice", keys.command(keys.FRAGMENT, "wizard", "alice"), False),
        ("manager", "alice", keys.command(keys.BEHAVIOR, "manager", "alice"), False),
        ("manager", "alice", keys.cancel("generation").replace("*/*", "manager/alice"), True),
        ("manager", "alice", keys.fault("alice"), True),
        ("manager", "alice", keys.fault("control"), False),
        ("observer", "viewer", keys.command(keys.FRAGMENT, "observer", "viewer"), False),
        ("recognition", "recognition", keys.connection_event("human", "backchannel"), True),
    ],
)
def test_what_a_process_may_have_sent(role: str, name: str, key: str, expected: bool) -> None:
    assert may_have_sent(run_of(role, name), key) is expected


def test_a_process_without_a_mark_may_have_sent_nothing() -> None:
    assert not any(may_have_sent(run, key) for run in ("", "1" * 32) for key in (keys.SYNC_POINT, keys.fault("x")))


def test_participants_carry_the_name_of_their_holder() -> None:
    alice = Holder(robot="robot", role="manager", name="alice")
    assert [alice.called(name) for name in ("alice", "alice-1", "alicia", "play-1")] == [
        "alice", "alice-1", "alice-alicia", "alice-play-1",
    ]  # fmt: skip


def test_what_the_router_would_drop_is_refused_by_name() -> None:
    rights = Rights(Holder(robot="robot", role="observer", name="viewer"))
    rights.check("viewer-1", "subscribes", keys.ANY_FEEDBACK)
    rights.check("viewer-1", "subscribes", keys.FEEDBACK)
    rights.check("viewer-1", "asks", keys.status("control"))
    with pytest.raises(InputRefused, match="robot/observer/viewer do not let it publish on"):
        rights.check("viewer-1", "publishes", keys.command(keys.BLOCK, "observer", "viewer-1"))
    with pytest.raises(InputRefused, match="subscribe to"):
        rights.check("viewer-1", "subscribes", keys.EVERYTHING)
    with pytest.raises(InputRefused, match="ask"):
        rights.check("viewer-1", "asks", keys.ESTIMATE)


@pytest.mark.parametrize(
    ("does", "key", "advice"),
    [
        ("publishes", keys.command(keys.ROBOT, "observer", "viewer-1"), "an operator or a wizard may"),
        ("publishes", keys.command(keys.FRAGMENT, "observer", "viewer-1"), "a manager or a wizard may"),
        ("publishes", keys.command(keys.BEHAVIOR, "observer", "viewer-1"), "generation or realizer may"),
        ("publishes", keys.PERCEIVED_ACTION, "perception or a wizard may"),
        ("asks", keys.ESTIMATE, "generation or realizer may"),
        ("subscribes", keys.EVERYTHING, "nobody may"),
    ],
)
def test_a_refusal_names_the_roles_that_may(does: Does, key: str, advice: str) -> None:
    rights = Rights(Holder(robot="robot", role="observer", name="viewer"))
    with pytest.raises(InputRefused) as refused:
        rights.check("viewer-1", does, key)
    assert refused.value.fault.advice == advice
