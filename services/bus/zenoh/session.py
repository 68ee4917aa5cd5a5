"""Sessions of Zenoh, opened as the bus needs them: as a peer, a client of a router, or a router."""

import asyncio
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf
from random import uniform
from secrets import token_hex
from typing import Any

import zenoh

from engage_hri.schemas.faults import Fault, InputRefused, NotReady, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import ADVICE, ENDPOINT, is_encrypted, is_endpoint, is_on_this_machine
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Keys
from engage_hri.services.bus.zenoh.rules import bounded

ROUTER_WITH_KEYS = "tls/localhost:7447"
"""Endpoint of the router for processes with keys that name no other."""
RENDEZVOUS = "tcp/127.0.0.1:7447"
"""Endpoint at which the processes of one machine find one another: the first listens there, all others connect."""
LOOPBACK = "tcp/127.0.0.1:0"
PEER_AFAR = (
    "a peer of other machines: after a cut it finds again only those that it names itself (--connect for each); "
    "a client of a router finds all (`engage router`)"
)
"""Warning: Zenoh does not dial again whom it has met through others."""
OPEN_TO_ALL = (
    "open to all: whoever reaches %s can drive the robot;"
    " make keys (`engage keys init`), unless the network is yours alone"
)
LEASE_MS = 2000
"""Time in which a silent link counts as alive: with shorter ones peers seem to go and come on cuts of 0.4 s."""
STALL_US = 200_000
"""Time that a full link may stall `put`, and so the loop, before it is closed. Zenoh's default is 5 s."""
ROUTER_STALL_US = 400_000
"""The same in a router with keys, which ends such links itself, sooner (links.py). Once Zenoh has begun to close a
link that nobody reads, nothing ends that, and each message for it halts whoever sends it."""
STALL = "transport/link/tx/queue/congestion_control/block/wait_before_close"
RUST_PLACE = re.compile(r" at /\S+\.rs:\d+\.?")
"""Place in Zenoh's source, at the end of its errors: of no use to a user."""
LINK_SETTINGS = re.compile(r"#so_\w+=[\w=;]+")
"""Our settings of a link, behind its endpoint there."""
_DO = {
    "(os error 13)": "a port below 1024 wants more rights: take another one",
    "(os error 98)": "something listens there: stop it, or take another port",
    "(os error 99)": "listen at an address of this machine, or at 0.0.0.0 for all that it has",
    "lookup address information": "no machine of this name is known: is it misspelled?",
}
"""Advice for errors of the system, by a part of their text."""
ROUTER_MS = 2000
"""Time that one try to reach a router may take, in which the loop stands still: nothing runs on it yet. Any link has
this time to open."""
TRY_AGAIN: tuple[Seconds, Seconds] = (0.25, 4.0)
"""First and longest pause before a router is called again: each is up to twice the one before, by chance. Else all
whom a router has lost would come back at once, and again at once if that is too much for it."""
TELL_AFTER: Seconds = 3.0
"""Time without a router after which it is told that there is none."""
RETRY_MS = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
"""Pauses of a process with a link that broke. Each process has up to twice these, by chance."""
MOST_SESSIONS = 4096
"""Links that a router gives. Zenoh's default is 1000."""
COMING = 1024
"""Of these, how many may be about to open."""
KNOCK: Seconds = 2.0
"""Time that a connection has to open, when it is asked whether anybody is there."""
ON_THE_WAY = {"so_sndbuf": 131_072, "so_rcvbuf": 131_072}
"""Bytes of a link that wait in the systems of its two ends. Systems let megabytes wait else, and what comes after a
flood waits behind all of them (docs/decisions/0126-a-flood-does-not-wait-in-the-system.md)."""

CAUSAL = zenoh.Priority.DATA
"""Priority of all ordered messages: Zenoh does not keep the order of messages with different ones."""
QOS: dict[str, Any] = {"congestion_control": zenoh.CongestionControl.BLOCK, "priority": CAUSAL, "express": True}
STREAM_QOS: dict[str, Any] = {
    "congestion_control": zenoh.CongestionControl.DROP,
    "priority": zenoh.Priority.DATA_LOW,
    "express": False,
}


def open_session(
    robot: str | None,
    connect: Sequence[str],
    listen: Sequence[str],
    rendezvous: str | None,
    mode: str = "peer",
    more: Mapping[str, object] = {},
) -> tuple[zenoh.Session, bool]:
    """Open a session in the robot's namespace; returns it, and whether it connects to others. Blocks for some ms.

    An endpoint where nobody listens costs nothing. robot None: in no namespace. rendezvous None: only the endpoints
    given. more: further settings of Zenoh. Raises InputRefused when one is misspelled, RunFailed when it is taken, or
    not of this machine.
    """
    _check(*connect, *listen)
    if afar := [each for each in listen if not is_encrypted(each) and not is_on_this_machine(each)]:
        LOG.warning(OPEN_TO_ALL, ", ".join(afar))
    if rendezvous is not None:
        try:
            session = zenoh.open(_config(robot, connect, (*listen, LOOPBACK, rendezvous), mode))
            return session, bool(connect)
        except zenoh.ZError:
            # Another process listens there. Never both listen and connect: the first would call itself for ever.
            connect = (*connect, rendezvous)
    try:
        session = zenoh.open(_config(robot, connect, tuple(listen) or (LOOPBACK,), mode, more))
        return session, bool(connect)
    except zenoh.ZError as error:
        where, reason = ", ".join((*listen, *connect)), LINK_SETTINGS.sub("", RUST_PLACE.sub("", str(error)))
        advice = next((advice for sign, advice in _DO.items() if sign in reason), ADVICE)
        raise RunFailed(Fault(reason=f"cannot open the bus: {reason}", where=where, advice=advice)) from error


async def open_client(
    robot: str, connect: Sequence[str], keys: Keys | None = None, patience: Seconds = inf
) -> zenoh.Session:
    """Open a session as a client of the first of these routers that answers. Waits for one, and says so in the log.

    keys: those of this process; None: the link is open. Raises InputRefused when an endpoint is misspelled, NotReady
    when no router has answered within `patience`.
    """
    _check(*connect)
    loop = asyncio.get_running_loop()
    tell_at, until = (loop.time() + each for each in (TELL_AFTER, patience))
    if patience < inf:
        tell_at = inf  # it is told at the end
    pause, longest = TRY_AGAIN
    more = {} if keys is None else {**encrypted(keys), "id": f"{keys.holder.mark}{token_hex(12)}"}
    while True:
        try:
            return zenoh.open(_config(robot, connect, (), "client", more))
        except zenoh.ZError as error:
            if loop.time() > until:
                reason, advice = await _why_no_link(connect, keys is not None)
                raise NotReady(Fault(reason=reason, advice=advice)) from error
            if loop.time() > tell_at:
                tell_at = inf
                LOG.warning("%s; waiting (%s)", *await _why_no_link(connect, keys is not None))
        await asyncio.sleep(pause * uniform(0.5, 1.0))
        pause = min(2 * pause, longest)


async def _why_no_link(connect: Sequence[str], with_keys: bool) -> tuple[str, str]:
    """Say that no router gives a link, and what to do: Zenoh tells the same of one that is full and of none."""
    for endpoint in connect:
        match = ENDPOINT.fullmatch(endpoint)
        assert match is not None, "they have been checked"
        with suppress(OSError):  # a refused call, or none: TimeoutError is one
            async with asyncio.timeout(KNOCK):
                _, writer = await asyncio.open_connection(match["host"].strip("[]"), int(match["port"]))
            writer.close()
            other = "it refuses our certificate" if with_keys else "it lets in only who has keys"
            return (
                f"{endpoint} is open, but gives no link",
                f"the router there is full, or {other}: its log says which",
            )
    return f"no router answers at {', '.join(connect)}", "`engage router --listen ENDPOINT` starts one"


def open_router(connect: Sequence[str], listen: Sequence[str], more: Mapping[str, object] = {}) -> zenoh.Session:
    """Open a session that passes on what others send one another. Raises InputRefused, RunFailed.

    more: further settings of Zenoh.
    """
    room = {"transport/unicast/max_sessions": MOST_SESSIONS, "transport/unicast/accept_pending": COMING}
    return open_session(None, connect, listen, None, "router", {**room, **more})[0]


def encrypted(keys: Keys) -> dict[str, object]:
    """Settings for links that are encrypted, between two sides that both show a certificate of our authority.

    A link ends when a certificate does. Who connects checks that the router's certificate is for the host it called.
    """
    own = {
        f"{side}_{what}": path
        for side in ("listen", "connect")
        for what, path in (("certificate", keys.certificate), ("private_key", keys.private))
    }
    trust = {"root_ca_certificate": keys.authority, "enable_mtls": True, "verify_name_on_connect": True}
    return {"transport/link/tls": {**own, **trust, "close_link_on_expiration": True, **ON_THE_WAY}}


def _check(*endpoints: str) -> None:
    for endpoint in endpoints:
        if not is_endpoint(endpoint):
            raise InputRefused(Fault(reason=f"{endpoint!r} is not an endpoint", advice=ADVICE))


def _config(
    robot: str | None, connect: Sequence[str], listen: Sequence[str], mode: str, more: Mapping[str, object] = {}
) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        # A background retry of listening makes close() hang for 10 s (1.10.2).
        "listen/timeout_ms": 0,
        "connect/endpoints": list(connect),
        # A client must have a router from the start. Others keep trying in the background; 0 would give up for good
        # on an endpoint where nobody listens yet.
        "connect/exit_on_failure": mode == "client",
        "connect/timeout_ms": ROUTER_MS if mode == "client" else -1,
        "connect/retry": RETRY_MS | {each: int(RETRY_MS[each] * uniform(1.0, 2.0)) for each in list(RETRY_MS)[:2]},
        "transport/unicast/open_timeout": ROUTER_MS,  # else close() waits 10 s, for one behind a cut
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "scouting/delay": 1,
        "timestamping/enabled": True,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tcp": ON_THE_WAY,
        STALL: STALL_US,
        "transport/shared_memory/enabled": False,
    }
    if robot is not None:
        settings["namespace"] = robot
    for key, value in {**settings, **bounded(), **more}.items():
        config.insert_json5(key, json.dumps(value))
    return config
