"""Refusals of a router in plain lines: links without a good certificate, and messages that no rule allows.

Zenoh tells both only in its log, which it writes to the standard output of the process, each message that is allowed
among them. Who watches over the router reads that, and picks out what was refused. The router itself must not: while
its loop waits for Zenoh, Zenoh may wait for whoever reads the log.
"""

import re
from collections import Counter
from collections.abc import Callable

from engage_hri.schemas.access import LONGEST_KEY
from engage_hri.schemas.text import printable
from engage_hri.services.bus.samples import is_told

LEVELS = (
    "error,zenoh_link_tls=debug,zenoh::net::routing::interceptor::access_control=trace,zenoh::net::routing::hat=off"
)
"""Parts of Zenoh's log that tell of refusals, and all errors but those about the end of what was denied."""
MOST = 200
"""Number of different refusals of one holder that are told; a flood of them fills neither log nor memory."""
WILD = 4
"""Most `$*` in a key of which nothing is told; of more it is told who sent it: each multiplies the time in which
Zenoh matches it. Keys of ours have one."""
LONGEST = 2 * LONGEST_KEY
"""Bytes of a line that are read: a holder can send longer keys than ours, and all that is told is kept."""
_COLOR = re.compile(rb"\x1b\[[0-9;]*m")
_THREAD = re.compile(rb"ThreadId\((\d+)\)")
_CHECKED = re.compile(
    r"(?P<cached>Using cached result: )?\b(?P<zid>[0-9a-f]++)(?: on \S*?CertCommonName\((?P<name>.*?)\)\S*)?"
    r" is (?P<verdict>un)?authorized to (?P<what>[A-Z][A-Za-z/ ]*) \((?P<flow>ingress|egress)\) on (?P<key>\S+)"
)
_WHO = re.compile(rb" ([0-9a-f]+) (?:on|is) ")
_AFTER = b"interceptor"
"""What stands in a line after its time and thread, and before what is said."""
_CACHING = re.compile(r"ACL \((?P<flow>ingress|egress)\): caching permissions for `(?P<key>.*?)`")
_LAST_CACHED = "Declare Liveliness Subscriber"
_ACCEPTED = re.compile(r"Accepted TLS connection .*Common Name: (?P<name>.*)\.$")
_NOBODY = re.compile(r"\b(?P<zid>[0-9a-f]++) did not match any configured ACL subject")
_REFUSED = re.compile(r"zenoh_link_tls\S*: (?P<reason>.*?)(?:\. Hint: .*)?$")
_LEVEL = re.compile(r"\d{4}-\d\d-\d\dT\S+Z +(?P<level>[A-Z]+) ")


class Denials:
    """Lines of Zenoh's log, turned into lines for people. tell: gets them.

    When a key is declared, Zenoh works out all that its holder may do with it, and logs that as if it had been tried.
    Such lines follow one another on a thread, and are left out.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._names: dict[bytes, str] = {}
        """Common names by process."""
        self._accepted: dict[bytes, str] = {}
        """Common name of the link that was accepted last, by thread."""
        self._caching: dict[bytes, tuple[str, str]] = {}
        """Flow and key for which permissions are being worked out, by thread."""
        self._count: Counter[str] = Counter()
        self._kinds: Counter[str] = Counter()
        """Number of different refusals, by what they are about."""
        self._news: dict[str, str] = {}
        """Text of each refusal, by what it counts as."""
        self._kind_of: dict[bytes, str] = {}
        """What lines count as that were told, without their time and thread."""

    def feed(self, line: bytes) -> bool:
        """Take a line of the log. Returns whether it shows that the router takes in something new.

        It does not while its tables are held; what others send one another may pass all the same.
        """
        if len(line) > LONGEST:
            line = line[:LONGEST] + b"..."
        if not self._caching and b"caching permissions" not in line and self._is_known(line):
            return False  # by far the most
        text = _COLOR.sub(b"", line).decode(errors="replace").strip()
        if (level := _LEVEL.match(text)) is None:
            return False  # the rest of a line: a key may have line ends
        caching = _CACHING.search(text)
        found = _THREAD.search(line)
        thread = found[1] if found else b""
        if (checked := _CHECKED.search(text)) is not None:
            self._check(thread, checked, line)
        elif caching is not None:
            self._caching[thread] = (caching["flow"], caching["key"])
        elif (accepted := _ACCEPTED.search(text)) is not None:
            self._accepted[thread] = accepted["name"]
        elif (nobody := _NOBODY.search(text)) is not None:
            name = self._accepted.get(thread, "somebody")
            self._know(nobody["zid"], name)
            self._say(f"denied: {name} has a certificate, but is not let in: it may do nothing")
        elif level["level"] in ("WARN", "ERROR"):
            refused = _REFUSED.search(text)
            self._say(f"refused a link: {refused['reason']}" if refused else f"zenoh: {text}")
        return caching is not None

    def _is_known(self, line: bytes) -> bool:
        """True for a line that says nothing new; one that was told before is counted. Quick, for there are many.

        New is an allowance of a process without a name yet, or of a costly key.
        """
        if _is_allowance(line):
            said = _WHO.search(line)
            return said is not None and said[1] in self._names and line.count(b"$*") <= WILD
        if (kind := self._kind_of.get(line[line.find(_AFTER) :])) is None:
            return False
        self._told_again(kind)
        return True

    def _check(self, thread: bytes, checked: re.Match[str], line: bytes) -> None:
        zid = checked["zid"]
        if checked["name"]:
            self._know(zid, checked["name"])
        who = self._names.get(zid.encode(), f"process {zid}")
        if (wild := checked["key"].count("$*")) > WILD and checked["flow"] == "ingress":
            news = f"costly: {who} has sent a key with {wild} `$*`; while it is matched the router stands still"
            self._say(news, f"of what {who} does")
        if (caching := self._caching.get(thread)) is not None:
            is_cached = not checked["cached"] and caching == (checked["flow"], checked["key"])
            if not is_cached or checked["what"] == _LAST_CACHED:
                del self._caching[thread]
            if is_cached:
                return
        # What is kept from somebody is nothing that they did; and the end of what never began is no news.
        if checked["verdict"] and checked["flow"] == "ingress" and not checked["what"].startswith("Undeclare"):
            news = f"denied: {who} may not {checked['what'].lower()} {checked['key']}"
            kind = self._say(news, f"of what {who} does")
            if len(self._kind_of) < MOST:
                self._kind_of[line[line.find(_AFTER) :]] = kind

    def _know(self, zid: str, name: str) -> None:
        if zid.encode() not in self._names and len(self._names) >= MOST:
            self._names.pop(next(iter(self._names)))
        self._names[zid.encode()] = name

    def _say(self, news: str, part: str = "") -> str:
        """Tell it, if it is new, or has come ten times as often; returns as what it counts.

        part: what one flood of news shall not hide.
        """
        news = printable(news)
        # The time in a reason makes every refusal of an expired certificate another one.
        kind = re.sub(r"\d+", "0", news) if news.startswith("refused") else news
        if kind not in self._count:
            if self._kinds[part] >= MOST:
                kind = news = f"more {part or 'that comes'} is refused than can be told"
            else:
                self._kinds[part] += 1
        self._news[kind] = news
        self._told_again(kind)
        return kind

    def _told_again(self, kind: str) -> None:
        self._count[kind] += 1
        times = self._count[kind]
        if is_told(times):
            self._tell(self._news[kind] if times == 1 else f"{self._news[kind]} ({times} times)")


def _is_allowance(line: bytes) -> bool:
    """Tell whether a line says that something is allowed. The verdict is before the key, which may hold any words."""
    verdict, found, _ = line.partition(b"authorized to ")
    return bool(found) and verdict.endswith(b" is ")
