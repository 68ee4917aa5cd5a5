"""Who has too many links or tokens at a router: counted by certificate, cut at the bound, let in again later."""

from engage_hri.schemas.access import Holder
from engage_hri.services.bus.zenoh.links import Link
from engage_hri.services.bus.zenoh.router import BANNED, MOST_LINKS, MOST_TOKENS, MOST_UNREAD, Crowd

ALICE = Holder(robot="robot", role="manager", name="alice")
BOB = Holder(robot="robot", role="manager", name="bob")


def link(holder: Holder | None, number: int) -> Link:
    name = holder.common_name if holder else ""
    return Link(f"{holder.mark if holder else ''}{number}", name, f"tls/127.0.0.1:{number}")


def test_one_link_more_than_the_bound_ends_all_of_that_certificate_and_no_other() -> None:
    crowd = Crowd((ALICE, BOB))
    crowd.came(link(BOB, 0), 0.0)
    assert all(crowd.came(link(ALICE, number), 0.0) == ("", ()) for number in range(MOST_LINKS))

    line, ended = crowd.came(link(ALICE, MOST_LINKS), 0.0)

    assert ALICE.common_name in line
    assert str(MOST_LINKS) in line
    assert set(ended) == {link(ALICE, number) for number in range(MOST_LINKS + 1)}


CONTROL = Holder(robot="robot", role="control", name="control")


def test_a_service_that_has_too_many_is_told_once_and_keeps_its_links() -> None:
    """Somebody else with its keys shows tokens of processes that are none: the service itself goes on."""
    crowd = Crowd((CONTROL,))
    for number in range(MOST_LINKS):
        crowd.came(link(CONTROL, number), 0.0)
    said = [crowd.shown(f"{CONTROL.mark}{number}", "token", 0.0) for number in range(MOST_LINKS + 2)]

    assert said[:-2] == [("", ())] * MOST_LINKS
    told = f"too many: {CONTROL.common_name} has more than {MOST_LINKS} processes"
    assert said[-2] == (f"{told}; a service of the robot keeps its links", ())
    assert said[-1] == crowd.came(link(CONTROL, MOST_LINKS), 1.0) == ("", ())
    assert not crowd.is_banned(link(CONTROL, 0), 1.0)
    assert crowd.unread(link(CONTROL, 0), 1.0) == ("", ())


def test_who_goes_makes_room() -> None:
    crowd = Crowd((ALICE,))
    for number in range(3 * MOST_LINKS):
        assert crowd.came(link(ALICE, number), 0.0) == ("", ())
        crowd.went(link(ALICE, number))


def test_who_had_too_many_gets_no_link_for_a_while_and_then_gets_one() -> None:
    crowd = Crowd((ALICE, BOB))
    for number in range(MOST_LINKS + 1):
        crowd.came(link(ALICE, number), 0.0)
    for number in range(MOST_LINKS + 1):
        crowd.went(link(ALICE, number))

    assert crowd.came(link(ALICE, 1000), BANNED - 0.1) == ("", (link(ALICE, 1000),))
    assert crowd.came(link(BOB, 1001), BANNED - 0.1) == ("", ())
    crowd.went(link(ALICE, 1000))
    assert crowd.came(link(ALICE, 1002), BANNED) == ("", ())


def test_tokens_of_all_processes_of_a_certificate_count_together() -> None:
    crowd = Crowd((ALICE, BOB))
    links = {link(ALICE, number) for number in range(2)}
    for each in links:
        crowd.came(each, 0.0)
    for number in range(MOST_TOKENS):
        assert crowd.shown(f"{ALICE.mark}{number % 2}", f"token-{number}", 0.0) == ("", ())
        assert crowd.shown(f"{ALICE.mark}{number % 2}", f"token-{number}", 0.0) == ("", ()), "the same token again"

    line, ended = crowd.shown(f"{ALICE.mark}7", "one more", 0.0)

    assert ALICE.common_name in line
    assert set(ended) == links
    assert crowd.shown(f"{ALICE.mark}7", "and another", 1.0) == ("", ()), "it is told once"


def test_tokens_that_are_withdrawn_do_not_count() -> None:
    crowd = Crowd((ALICE,))
    for number in range(3 * MOST_TOKENS):
        assert crowd.shown(f"{ALICE.mark}1", f"token-{number}", 0.0) == ("", ())
        crowd.withdrawn(f"{ALICE.mark}1", f"token-{number}")


def test_without_keys_tokens_are_counted_by_process_and_links_not_at_all() -> None:
    crowd = Crowd()
    for number in range(3 * MOST_LINKS):
        assert crowd.came(link(None, number), 0.0) == ("", ())
    for number in range(MOST_TOKENS):
        assert crowd.shown("7", f"token-{number}", 0.0) == ("", ())

    line, ended = crowd.shown("7", "one more", 0.0)

    assert "process 7" in line
    assert ended == (link(None, 7),)


def test_a_certificate_whose_tokens_name_more_processes_than_it_may_have_links_is_cut() -> None:
    crowd = Crowd((ALICE, BOB))
    crowd.came(link(ALICE, 0), 0.0)
    for number in range(3 * MOST_LINKS):
        assert crowd.shown(f"{ALICE.mark}{number}", f"token-{number}", 0.0) == ("", ())
        crowd.withdrawn(f"{ALICE.mark}{number}", f"token-{number}")
        crowd.withdrawn(f"{ALICE.mark}{number}", f"token-{number}")
    for number in range(MOST_LINKS):
        for what in ("alive", "log"):
            assert crowd.shown(f"{ALICE.mark}{number}", f"{what}-{number}", 0.0) == ("", ())

    line, ended = crowd.shown(f"{ALICE.mark}one more", "of no process", 0.0)

    assert f"{ALICE.common_name} has more than {MOST_LINKS} processes" in line
    assert ended == (link(ALICE, 0),)
    assert crowd.shown(f"{BOB.mark}0", "another's", 0.0) == ("", ())


def test_links_that_are_not_read_end_and_so_do_all_of_a_certificate_that_has_many_of_them_within_a_while() -> None:
    crowd = Crowd((ALICE, BOB))
    for number in range(MOST_UNREAD + 2):
        crowd.came(link(ALICE, number), 0.0)
    for number in range(MOST_UNREAD):
        line, ended = crowd.unread(link(ALICE, number), float(number))
        assert line.startswith(f"not read: {ALICE.common_name}")
        assert ended == (link(ALICE, number),)
        assert crowd.unread(link(ALICE, number), float(number)) == ("", ended), "it is told once"
        crowd.went(link(ALICE, number))
    assert crowd.unread(link(BOB, 0), 3.0)[1] == (link(BOB, 0),)

    line, ended = crowd.unread(link(ALICE, MOST_UNREAD), 5.0)

    assert f"{ALICE.common_name} has more than {MOST_UNREAD} links that are not read" in line
    assert {*ended} == {link(ALICE, MOST_UNREAD), link(ALICE, MOST_UNREAD + 1)}


def test_links_that_are_not_read_are_forgotten_after_a_while() -> None:
    crowd = Crowd((ALICE,))
    for number in range(3 * MOST_UNREAD):
        assert crowd.unread(link(ALICE, number), number * BANNED / MOST_UNREAD)[0].startswith("not read: ")


def test_a_link_that_is_not_read_stays_if_it_is_a_service_or_nobody_can_know_whose_it_is() -> None:
    control = Holder(robot="robot", role="control", name="control")
    crowd = Crowd((ALICE, control))
    for number in range(3 * MOST_UNREAD):
        for holder in (control, None):
            assert crowd.unread(link(holder, number), 0.0) == ("", ())
