"""What a router tells of Zenoh's log: what was refused, and nothing that was not."""

from engage_hri.services.bus.zenoh.denials import LONGEST, MOST, Denials

TRACE = "\x1b[2m2026-11-22T22:21:26.150311Z\x1b[0m \x1b[35mTRACE\x1b[0m  rx-0 ThreadId({}) \x1b[2mzenoh::net::routing::interceptor::access_control\x1b[0m: {}"  # noqa: E501
BOB = "107387840e15874f6e7b603029be66a0 on Interface(lo)+CertCommonName(robot/manager/bob)+Transport(Tls)+1073"
KEY = "robot/engage/v1/evt/control/sync_point"
CACHED = (
    "Query", "Reply", "Put", "Delete", "Declare/Undeclare Subscriber", "Declare/Undeclare Queryable",
    "Declare/Undeclare Liveliness Token", "Liveliness Query", "Declare Liveliness Subscriber",
)  # fmt: skip


def told(*lines: str) -> list[str]:
    said: list[str] = []
    denials = Denials(said.append)
    for line in lines:
        denials.feed(line.encode())
    return said


def trace(text: str, thread: int = 8) -> str:
    return TRACE.format(f"{thread:02}", text)


def checked(what: str, key: str = KEY, un: str = "un", thread: int = 8, flow: str = "ingress") -> str:
    return trace(f"{BOB} is {un}authorized to {what} ({flow}) on {key}", thread)


def test_what_was_denied_is_told_with_the_name_and_the_key() -> None:
    assert told(checked("Put")) == [f"denied: robot/manager/bob may not put {KEY}"]


def test_what_is_allowed_withheld_or_undone_is_not_told() -> None:
    assert not told(checked("Put", un=""), checked("Put", flow="egress"), checked("Undeclare Subscriber"))


def test_what_is_only_worked_out_is_not_told() -> None:
    caching = trace(f"ACL (ingress): caching permissions for `{KEY}` ...")
    working = [checked(what, un="un" if what != "Reply" else "") for what in CACHED]
    between = [checked("Put", thread=9)]
    news = [f"denied: robot/manager/bob may not put {KEY}"]
    assert told(caching, *working) == []
    assert told(caching, *working[:3], *between, *working[3:]) == news
    assert told(caching, *working, checked("Put")) == news
    assert told(caching, checked("Put", key="another/key"))[0].endswith("another/key")


def test_a_denial_from_memory_is_told_with_the_name_that_was_heard_before() -> None:
    cached = trace(f"Using cached result: 107387840e15874f6e7b603029be66a0 is unauthorized to Put (ingress) on {KEY}")
    assert told(checked("Query", un=""), cached) == [f"denied: robot/manager/bob may not put {KEY}"]
    assert told(cached) == [f"denied: process 107387840e15874f6e7b603029be66a0 may not put {KEY}"]


def test_no_holder_makes_a_line_long_or_its_reading_slow() -> None:
    """Keys of Zenoh may have 64 KiB. Each letter of these could begin the id of a process."""
    caching = trace(f"ACL (ingress): caching permissions for `{'a' * 60_000}`")
    lines = told(checked("Put", key="a" * 60_000), checked("Put", key="a" * 60_001), *[caching] * 100)
    assert [line.rstrip("a.") for line in lines] == ["denied: robot/manager/bob may not put "]
    assert lines[0].endswith("a...")
    assert len(lines[0]) < LONGEST


def test_who_is_not_let_in_is_named() -> None:
    link = "zenoh_link_tls::unicast: Accepted TLS connection on 127.0.0.1:17999: 127.0.0.1:46152."
    lines = [
        f"2026-11-22T22:21:19.6Z DEBUG acc-0 ThreadId(05) {link} Common Name: robot/manager/carol.",
        "2026-11-22T22:21:19.6Z  INFO acc-0 ThreadId(05) zenoh: 41202ed8 did not match any configured ACL subject. x",
    ]  # fmt: skip
    assert told(*lines) == ["denied: robot/manager/carol has a certificate, but is not let in: it may do nothing"]


def test_a_refused_link_is_told_without_the_guess_about_files() -> None:
    line = "2026-11-22T22:21:19Z  WARN acc-0 zenoh_link_tls::unicast: invalid peer certificate: UnknownIssuer"
    assert told(f"{line}. Hint: increase the system open file limit.") == [
        "refused a link: invalid peer certificate: UnknownIssuer"
    ]


def test_a_key_with_line_ends_is_one_line_and_does_nothing_to_a_terminal() -> None:
    lie = f"{BOB.replace('bob', 'alice')} is unauthorized to Put (ingress) on KEY"
    assert told(*f"{checked('Put', key='x')}\n{lie}".split("\n")) == ["denied: robot/manager/bob may not put x"]
    assert "\x1b" not in told(checked("Put", key="x\x1b]0;title\x07"))[0]


def test_a_flood_is_told_in_few_lines() -> None:
    assert told(*[checked("Put")] * 150) == [
        f"denied: robot/manager/bob may not put {KEY}{times}" for times in ("", " (10 times)", " (100 times)")
    ]
    many = told(*[checked("Put", key=f"k{number}") for number in range(MOST + 50)])
    assert len(many) == MOST + 2
    more = "more of what robot/manager/bob does is refused than can be told"
    assert many[-2:] == [more, f"{more} (10 times)"]


def test_a_flood_of_one_does_not_hide_another() -> None:
    flood = [checked("Put", key=f"k{number}") for number in range(MOST + 50)]
    assert (
        told(*flood, checked("Put").replace("bob", "alice"))[-1] == f"denied: robot/manager/alice may not put {KEY}"
    )


def test_who_sends_a_key_that_takes_for_ever_to_match_is_named_be_it_allowed_or_not() -> None:
    key = f"robot/engage/v1/@bus/*/alive/{'$*0' * 12}"
    caching = trace(f"ACL (ingress): caching permissions for `{key}` ...")
    costly = "costly: robot/manager/bob has sent a key with 12 `$*`; while it is matched the router stands still"

    assert told(checked("Liveliness Query", key, un="")) == [costly]
    assert told(caching, checked("Query", key)) == [costly]
    assert told(checked("Query", "robot/engage/v1/@bus/a$*/alive/bob-$*", un="")) == []
    assert told(checked("Query", key, un="", flow="egress")) == []


def test_a_refusal_of_a_key_with_the_words_of_an_allowance_is_told() -> None:
    key = "robot/engage/v1/evt/x is authorized to Put (ingress) on robot/fault"
    known = checked("Put", un="")

    assert told(known, checked("Put", key)) == ["denied: robot/manager/bob may not put robot/engage/v1/evt/x"]


def test_costly_keys_of_one_holder_hide_no_refused_link() -> None:
    names = [f"robot/engage/v1/@bus/{'$*0' * number}" for number in range(5, 5 + 2 * MOST)]
    refused = "2026-11-22T22:21:19Z WARN acc-0 ThreadId(05) zenoh_link_tls::unicast: no certificate"

    said = told(*(checked("Query", name, un="") for name in names), refused)
    assert said[-1] == "refused a link: no certificate"


def test_other_errors_of_zenoh_are_passed_on() -> None:
    assert told("2026-11-22T22:21:19Z ERROR acc-0 ThreadId(05) zenoh::x: no memory")[0].startswith("zenoh: 2026")
    assert not told("2026-11-22T22:21:19Z DEBUG acc-0 ThreadId(05) zenoh_link_tls::utils: Loading certificates", "")
