"""Bounds that Zenoh keeps where a message comes in, before Python sees it. Pure.

Zenoh compares with the smallest limit of all expressions that include a message's key. So each row of the table has
its own here, and what is in no row the greatest.
"""

from collections.abc import Iterable
from typing import Any

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import BESIDE, LARGEST, MOST_PULSES, OWN, ROUTER, Holder, most

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
