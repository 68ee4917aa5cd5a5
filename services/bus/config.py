"""Section `[bus]` of the configuration, and variables of the environment: where a process finds the bus."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused

Mode = Literal["auto", "peer", "client"]
ENDPOINT = re.compile(r"(?:tcp|tls)/(?P<host>\[[^\s\]]+\]|[^\s/:\[\]]+):(?P<port>\d{1,5})(?:[?#]\S*)?")
"""Endpoints of protocols that retransmit. Zenoh itself would go on calling a misspelled one in silence."""
ADVICE = "tcp/HOST:PORT or tls/HOST:PORT"
PREFIX = "ENGAGE_BUS_"
"""First part of the names of variables of the environment; the rest is a key of the section in capitals."""
_OWN = re.compile(r"localhost|127(\.\d+){3}|\[::1\]")


class BusConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The robot, and how a process comes to its bus. Raises ValueError when a value cannot be."""

    robot: str = "robot"
    """The robot's namespace on the bus, and its actor id."""
    mode: Mode = "auto"
    """client: connects to a router (`engage router`), as is best across machines. peer: processes connect to one
    another, as is quickest on one machine. auto: client if an endpoint to connect to is on another machine."""
    connect: tuple[str, ...] = ()
    """Endpoints to connect to, `tcp/HOST:PORT`. None: the processes of this machine find one another."""
    keys: str = ""
    """Folder of keys that `engage keys` has made, of one holder or of all. With keys, processes connect to a router
    by `tls/HOST:PORT` (without `connect`: to one on this machine), and do only what the holder's role may."""

    def __post_init__(self) -> None:
        if not self.robot or not set(self.robot).isdisjoint("/*$#?@ "):
            reason = "it has one of / * $ # ? @ or a space" if self.robot else "it is empty"
            raise ValueError(f"robot {self.robot!r} cannot be part of a key: {reason}")
        for endpoint in self.connect:
            if not is_endpoint(endpoint):
                raise ValueError(f"{endpoint!r} is not an endpoint, {ADVICE}")
        if self.mode == "client" and not self.connect and not self.keys:
            raise ValueError("mode 'client' takes an endpoint in `connect`")
        if self.keys and self.mode == "peer":
            raise ValueError("mode 'peer' with keys: the rules are the router's, so all are its clients")
        if self.keys and (plain := [each for each in self.connect if not is_encrypted(each)]):
            raise ValueError(f"{plain[0]!r} with keys: connect to tls/HOST:PORT")


def is_endpoint(text: str) -> bool:
    """True for an endpoint of a protocol that we use."""
    match = ENDPOINT.fullmatch(text)
    return match is not None and int(match["port"]) <= 65535


def is_encrypted(endpoint: str) -> bool:
    """True for an endpoint whose link is encrypted."""
    return endpoint.startswith("tls/")


def is_on_this_machine(endpoint: str) -> bool:
    """True for an endpoint that only processes of this machine can reach."""
    match = ENDPOINT.fullmatch(endpoint)
    return match is not None and _OWN.fullmatch(match["host"]) is not None


def mode_of(mode: Mode, connect: Sequence[str], listen: Sequence[str], keys: str = "") -> Literal["peer", "client"]:
    """The mode in which to come to the bus. Others can connect to a peer only, so who listens is one."""
    if keys:
        return "client"
    if mode == "auto":
        return "client" if not listen and not all(map(is_on_this_machine, connect)) else "peer"
    return mode


def environment(variables: Mapping[str, str]) -> dict[str, Any]:
    """The table of settings that variables of the environment give. Raises InputRefused for an unknown one."""
    found: dict[str, Any] = {}
    for name, text in variables.items():
        if not name.startswith(PREFIX):
            continue
        key = name.removeprefix(PREFIX).lower()
        if key not in BusConfig.__struct_fields__:
            advice = ", ".join(f"{PREFIX}{each.upper()}" for each in BusConfig.__struct_fields__)
            raise InputRefused(Fault(reason="unknown variable of the environment", where=name, advice=advice))
        found[key] = text.replace(",", " ").split() if key == "connect" else text
    return {"bus": found} if found else {}
