"""Rights of a process with keys. What it may not do is refused here, by name: the router drops it without a word."""

from collections.abc import Sequence
from functools import lru_cache

import zenoh

from engage_hri.schemas import access
from engage_hri.schemas.access import Does, Holder, owned
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.keys import SERVICES
from engage_hri.services.bus.config import Mode, is_encrypted
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Keys

TOLD = 1000
"""Number of forged messages that are told one by one, so that a flood of them does not fill the log."""
_DOING = {"publishes": "publish on", "subscribes": "subscribe to", "serves": "answer on", "asks": "ask"}


class Rights:
    """Rights of a holder, and of those whose messages come in."""

    def __init__(self, holder: Holder) -> None:
        self.holder = holder
        self._told: set[tuple[str, str]] = set()

    def called(self, name: str) -> str:
        """Name of a participant in this process."""
        return self.holder.called(name)

    def check(self, name: str, does: Does, key: str) -> None:
        """Raise InputRefused for what the router would drop. name: of the participant that does it."""
        if not _is_granted(self.holder.role, name, does, key):
            reason = f"the keys of {self.holder.common_name} do not let it {_DOING[does]} {key}"
            raise InputRefused(Fault(reason=reason, where=name, advice=f"{_who_may(name, does, key)} may"))

    def trusts(self, run: str, key: str, source: str) -> bool:
        """Tell whether a message on this key can be from this process; tells of one that is forged in the log."""
        if access.may_have_sent(run, key):
            return True
        if (run, key) not in self._told and len(self._told) < TOLD:
            self._told.add((run, key))
            LOG.warning(
                "dropped: a message on %s that says it is from process %s (%s), whose keys do not allow that;"
                " so is all more of its kind",
                key, run, source or "no name",
            )  # fmt: skip
        return False


def check_keys(keys: Keys, robot: str, connect: Sequence[str], listen: Sequence[str], mode: Mode) -> None:
    """Raise InputRefused for what does not go with the keys of a process."""
    where = str(keys.folder)
    if keys.holder.robot != robot:
        raise InputRefused(
            Fault(reason=f"these keys are for robot {keys.holder.robot!r}, not {robot!r}", where=where)
        )
    if listen or mode == "peer":
        reason = "with keys a process does not listen: the rules are the router's, so all are its clients"
        raise InputRefused(Fault(reason=reason, where=where, advice="leave --listen and --mode out"))
    if plain := [each for each in connect if not is_encrypted(each)]:
        raise InputRefused(Fault(reason=f"{plain[0]!r} with keys", where=where, advice="tls/HOST:PORT"))


def _who_may(name: str, does: Does, key: str) -> str:
    """Name the roles that may do what was refused. In the key of a command the role is that of its sender."""
    chunks = key.split("/")
    roles = []
    for role in access.ROLES:
        if chunks[2:3] == ["cmd"] and does == "publishes":
            chunks[4] = role
        if _is_granted(role, name, does, "/".join(chunks)):
            article = "" if role in (*SERVICES, "perception") else "an " if role[0] in "aeiou" else "a "
            roles.append(f"{article}{role}")
    return " or ".join(roles) or "nobody"


@lru_cache(4096)  # asked for every message
def _is_granted(role: str, name: str, does: Does, key: str) -> bool:
    return any(zenoh.KeyExpr(owned(row, name)).includes(key) for row in access.rows(role, does))
