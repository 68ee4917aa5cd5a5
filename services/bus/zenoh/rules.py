"""Rules that Zenoh keeps where a message comes in, before Python sees it, made from the table of access. Pure.

*Whose*: a router with keys checks each message twice: from the one who sends (ingress), and to the one who gets it
(egress). What no rule allows is dropped. *How large*: every session drops what is larger than its key allows. Zenoh
compares with the smallest limit of all expressions that include a message's key. So each row of the table has its own
here, and what is in no row the greatest. *How often*: of pulses alone a router passes on only so many.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import BESIDE, LARGEST, MOST_PULSES, OWN, ROUTER, Holder, most, owned

EVERY_KIND = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
ANYTHING = ("**", f"*/{keys.ANY_OWN}")
"""Expressions for all keys: no wildcard includes the `@` of the bus' own."""


def access_control(holders: Iterable[Holder]) -> dict[str, Any]:
    """Make the section `access_control` of a router's configuration, for these holders: all others are denied."""
    rules, subjects, policies = [], [], []
    for holder in holders:
        name = holder.common_name
        subjects.append({"id": name, "cert_common_names": [name]})
        own = [
            {
                "id": f"{name} {flow} {kind}",
                "permission": "allow",
                "flows": [flow],
                "messages": [kind],
                "key_exprs": sorted({_within(holder, key) for key in allowed}),
            }
            for flow, kind, allowed in _grants(holder)
        ]
        rules += own
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [name]})
    section: dict[str, Any] = {"enabled": True, "default_permission": "deny"}
    return section | {"rules": rules, "subjects": subjects, "policies": policies}


def _within(holder: Holder, key: str) -> str:
    return key if holder.role == ROUTER else f"{holder.robot}/{key}"


def _grants(holder: Holder) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Flow, kind of message, and the keys allowed for it."""
    if holder.role == ROUTER:
        yield from ((flow, kind, ANYTHING) for flow in ("ingress", "egress") for kind in EVERY_KIND)
        return
    publishes, subscribes, serves, asks = (
        tuple(_named(access.rows(holder.role, does), holder.name))
        for does in ("publishes", "subscribes", "serves", "asks")
    )
    runs = f"{holder.mark}$*"
    told = tuple(dict.fromkeys(flow for key in publishes for flow in keys.flows(key)))
    heard = tuple(dict.fromkeys(flow for key in subscribes for flow in keys.flows(key)))
    # What a process answers about what it has published. Each reply is checked under its own key, also one to a
    # question on `@bus/<run>/past`.
    past = tuple(keys.of_class(kind) for flow in told for kind in keys.FLOWS[flow])
    answered = tuple(
        keys.own(runs, each) for each in ("past", "counts", "clock", *(f"flush/{flow}" for flow in heard))
    )
    asked = tuple(keys.own("*", each) for each in ("past", "clock", *(f"flush/{flow}" for flow in told)))
    pulses = tuple(keys.own("*", f"pulse/{flow}") for flow in heard)
    # Tokens have keys of fixed depth, with known words but for names, runs and clocks.
    own = keys.tokens(keys.alive(OWN, keys.part_of(holder.role))).replace("/*/", f"/{runs}/", 1)
    shown = (*_named((own,), holder.name), *(keys.own(runs, f"log/{flow}") for flow in told))
    seen = tuple(
        dict.fromkeys(keys.tokens(each) for each in (keys.ANY_ROBOT_ALIVE, *map(keys.presence, subscribes)) if each)
    )
    seen += tuple(keys.own("*", f"log/{flow}") for flow in heard)
    yield "ingress", "put", (*publishes, *(keys.own(runs, f"pulse/{flow}") for flow in told))
    yield "ingress", "declare_subscriber", (*subscribes, *pulses)
    yield "ingress", "declare_queryable", (*serves, *answered, *past)
    yield "ingress", "reply", (*serves, *answered, *publishes)
    yield "ingress", "query", (*asks, *asked, *subscribes)
    yield "ingress", "liveliness_token", shown
    yield "ingress", "declare_liveliness_subscriber", seen
    yield "ingress", "liveliness_query", seen
    yield "egress", "put", (*subscribes, *pulses)
    yield "egress", "declare_subscriber", (keys.EVERYTHING, keys.ANY_OWN, keys.ROBOT_SOUND, keys.ANY_SOUND)
    yield "egress", "declare_queryable", (keys.EVERYTHING, keys.ANY_OWN)
    yield "egress", "query", (*serves, access.ANY_STATUS, keys.ANY_OWN, *past)
    yield "egress", "reply", (*asks, *subscribes, keys.ANY_OWN)
    yield "egress", "liveliness_token", seen


def _named(rows: Iterable[str], name: str) -> Iterator[str]:
    """Keys of the rows, with the names that the holder's participants may have."""
    for row in rows:
        yield owned(row, name)
        if OWN in row:
            yield owned(row, f"{name}-$*")


MOST_IN_PARTS = LARGEST + 2 * BESIDE
"""Bytes of a message that Zenoh puts together again; it drops a longer one in the middle, and the link stays."""
_OF_THE_BUS = tuple(keys.own("*", subject) for subject in ("pulse/*", "past", "counts", "clock", "flush/*"))
_DATA = ("put", "delete", "query", "reply")


def bounded() -> dict[str, object]:
    """Settings of every session: how large a message may be that comes in, by its key."""
    by_size: dict[int, set[str]] = {LARGEST: {"**"}}
    sent = {_of_all(row.key) for row in access.TABLE if row.does != "subscribes"}
    for key in (*sent, *_OF_THE_BUS):
        by_size.setdefault(most(key), set()).add(f"*/{key}")
    filters = [
        {"flows": ["ingress"], "messages": _DATA, "key_exprs": sorted(expressions), "size_limit": size + BESIDE}
        for size, expressions in by_size.items()
    ]
    return {"transport/link/rx/max_message_size": MOST_IN_PARTS, "low_pass_filter": filters}


def _of_all(key: str) -> str:
    """Expression for this key of all holders and roles."""
    chunks = key.replace(OWN, "*").split("/")
    if chunks[2] == "cmd":
        chunks[4:6] = "*", "*"
    return "/".join(chunks)


def paced(holders: Iterable[Holder]) -> list[dict[str, Any]]:
    """Section `downsampling` of a router's configuration: how many pulses of each holder come in on a link.

    Zenoh passes on one message in a span of time, and drops the next ones. So only what comes again has a rate.
    """
    rules = [
        {"key_expr": f"{holder.robot}/{keys.own(f'{holder.mark}$*', f'pulse/{flow}')}", "freq": float(MOST_PULSES)}
        for holder in holders
        if holder.role != ROUTER
        for flow in keys.FLOWS  # a process tells of both at once
    ]
    return [{"flows": ["ingress"], "messages": ["put"], "rules": rules}] if rules else []
