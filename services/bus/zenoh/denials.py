"""Refusals of a router in plain lines: links without a good certificate, messages that no rule allows, and too large
or too many ones.

Zenoh tells both only in its log, which it writes to the standard output of the process, each message that is allowed
among them. So the log goes through a pipe here, and the loop picks out what was refused.
"""

import asyncio
import os
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import zenoh

from engage_hri.schemas.utf8 import printable

LEVELS = "error,zenoh_link_tls=debug,zenoh::net::routing::interceptor=trace,zenoh::net::routing::hat=off"
"""Parts of Zenoh's log that tell of refusals, and all errors but those about the end of what was denied."""
MOST = 200
"""Number of different refusals of one holder that are told; a flood of them fills neither log nor memory."""
WILD = 4
"""Number of `$*` in a key from which on it is told who sent it: each multiplies the time in which Zenoh matches it.
Keys of ours have one."""
PIPE = 2**20
"""Bytes of the log that may wait for the loop; beyond, the router waits."""
_COLOR = re.compile(rb"\x1b\[[0-9;]*m")
_THREAD = re.compile(r"ThreadId\((\d+)\)")
_CHECKED = re.compile(
    r"(?P<cached>Using cached result: )?(?P<zid>[0-9a-f]+)(?: on \S*?CertCommonName\((?P<name>.*?)\)\S*)?"
    r" is (?P<verdict>un)?authorized to (?P<what>[A-Z][A-Za-z/ ]*) \((?P<flow>ingress|egress)\) on (?P<key>\S+)"
)
_CACHING = re.compile(r"ACL \((?P<flow>ingress|egress)\): caching permissions for `(?P<key>.*?)`")
_LAST_CACHED = "Declare Liveliness Subscriber"
_ACCEPTED = re.compile(r"Accepted TLS connection .*Common Name: (?P<name>.*)\.$")
_NOBODY = re.compile(r"(?P<zid>[0-9a-f]+) did not match any configured ACL subject")
_REFUSED = re.compile(r"zenoh_link_tls\S*: (?P<reason>.*?)(?:\. Hint: .*)?$")
_TOO_MANY = re.compile(r"dropped by the downsampling interceptor: \w+\((?P<key>.*)\) from:\S*/(?P<zid>\w+):\d+")
_DROPPED = b"Msg intercepted!"
"""Last line about any message that is dropped, whatever the reason. It names nobody."""
_LEVEL = re.compile(r"\d{4}-\d\d-\d\dT\S+Z +(?P<level>[A-Z]+) ")


class Denials:
    """Lines of Zenoh's log, turned into lines for people. tell: gets them.

    When a key is declared, Zenoh works out all that its holder may do with it, and logs that as if it had been tried.
    Such lines follow one another on a thread, and are left out.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._names: dict[str, str] = {}
        """Common names by process."""
        self._accepted: dict[str, str] = {}
        """Common name of the link that was accepted last, by thread."""
        self._caching: dict[str, tuple[str, str]] = {}
        """Flow and key for which permissions are being worked out, by thread."""
        self._count: Counter[str] = Counter()
        self._kinds: Counter[str] = Counter()
        """Number of different refusals, by what they are about."""
        self._before: dict[bytes, bytes] = {}
        """Last line of each thread."""

    def feed(self, line: bytes) -> None:
        """Take a line of the log."""
        begin = line.find(b"ThreadId(")
        on = line[begin : line.find(b")", begin)]
        if line.endswith(_DROPPED):
            self._drop(self._before.pop(on, b""))
            return
        if on in self._before or len(self._before) < MOST:  # a key may have line ends, and say anything
            self._before[on] = line
        if b"Using cached result" in line and b"unauthorized" not in line:
            return  # by far the most
        text = _COLOR.sub(b"", line).decode(errors="replace").strip()
        if (level := _LEVEL.match(text)) is None:
            return  # the rest of a line: a key may have line ends
        found = _THREAD.search(text)
        thread = found[1] if found else ""
        if (checked := _CHECKED.search(text)) is not None:
            self._check(thread, checked)
        elif (caching := _CACHING.search(text)) is not None:
            self._caching[thread] = (caching["flow"], caching["key"])
        elif (many := _TOO_MANY.search(text)) is not None:
            who = next((name for zid, name in self._names.items() if zid.startswith(many["zid"])), "somebody")
            self._say(f"dropped: {who} sends more on {many['key']} than may come in a second", f"of what {who} does")
        elif (accepted := _ACCEPTED.search(text)) is not None:
            self._accepted[thread] = accepted["name"]
        elif (nobody := _NOBODY.search(text)) is not None:
            name = self._accepted.get(thread, "somebody")
            self._know(nobody["zid"], name)
            self._say(f"denied: {name} has a certificate, but is not let in: it may do nothing")
        elif level["level"] in ("WARN", "ERROR"):
            refused = _REFUSED.search(text)
            self._say(f"refused a link: {refused['reason']}" if refused else f"zenoh: {text}")

    def _drop(self, before: bytes) -> None:
        """Tell what was dropped though a rule allows it: it is too large. before: what was said of it."""
        checked = _CHECKED.search(_COLOR.sub(b"", before).decode(errors="replace"))
        if checked is not None and not checked["verdict"] and checked["flow"] == "ingress":
            who = self._names.get(checked["zid"], f"process {checked['zid']}")
            what = f"{checked['what'].lower()} on {checked['key']}"
            self._say(f"dropped: {who} sends a {what} that is larger than may be sent", f"of what {who} does")

    def _check(self, thread: str, checked: re.Match[str]) -> None:
        if checked["name"]:
            self._know(checked["zid"], checked["name"])
        who = self._names.get(checked["zid"], f"process {checked['zid']}")
        if (wild := checked["key"].count("$*")) > WILD and checked["flow"] == "ingress":
            self._say(f"costly: {who} has sent a key with {wild} `$*`; while it is matched the router stands still")
        if (caching := self._caching.get(thread)) is not None:
            is_cached = not checked["cached"] and caching == (checked["flow"], checked["key"])
            if not is_cached or checked["what"] == _LAST_CACHED:
                del self._caching[thread]
            if is_cached:
                return
        # What is kept from somebody is nothing that they did; and the end of what never began is no news.
        if checked["verdict"] and checked["flow"] == "ingress" and not checked["what"].startswith("Undeclare"):
            self._say(f"denied: {who} may not {checked['what'].lower()} {checked['key']}", f"of what {who} does")

    def _know(self, zid: str, name: str) -> None:
        if zid not in self._names and len(self._names) >= MOST:
            self._names.pop(next(iter(self._names)))
        self._names[zid] = name

    def _say(self, news: str, part: str = "") -> None:
        """Tell it, if it is new, or has come ten times as often. part: what one flood of news shall not hide."""
        news = printable(news)
        # The time in a reason makes every refusal of an expired certificate another one.
        kind = re.sub(r"\d+", "0", news) if news.startswith("refused") else news
        if kind not in self._count:
            if self._kinds[part] >= MOST:
                kind = news = f"more {part or 'that comes'} is refused than can be told"
            else:
                self._kinds[part] += 1
        self._count[kind] += 1
        times = self._count[kind]
        if times == 1:
            self._tell(news)
        elif str(times).rstrip("0") == "1":
            self._tell(f"{news} ({times} times)")


@contextmanager
def telling_denials(tell: Callable[[str], None]) -> Iterator[None]:
    """Tell what is refused while the body of `with` runs; Zenoh sessions are opened in it. Once in a process.

    Standard output is Zenoh's meanwhile; Python's `sys.stdout` goes where it went before. tell: waits for no reader.
    """
    loop, rest = asyncio.get_running_loop(), b""
    coming, going = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    os.set_blocking(going, True)
    with suppress(ImportError, OSError):
        from fcntl import F_SETPIPE_SZ, fcntl

        fcntl(going, F_SETPIPE_SZ, PIPE)

    def read() -> None:
        nonlocal rest
        with suppress(BlockingIOError):
            *lines, rest = (rest + os.read(coming, PIPE)).split(b"\n")
            for line in lines:
                denials.feed(line)

    before, kept = sys.stdout, os.dup(1)
    before.flush()
    denials = Denials(tell)
    levels = os.environ.get("RUST_LOG")
    os.environ["RUST_LOG"] = LEVELS
    zenoh.init_log_from_env_or(LEVELS)
    if levels is None:
        del os.environ["RUST_LOG"]
    else:
        os.environ["RUST_LOG"] = levels
    os.dup2(going, 1)
    sys.stdout = open(kept, "w", closefd=False)  # noqa: SIM115 - closed below
    loop.add_reader(coming, read)
    try:
        yield
    finally:
        loop.remove_reader(coming)
        os.dup2(kept, 1)
        read()
        with suppress(OSError):
            sys.stdout.close()
        sys.stdout = before
        for each in (kept, coming, going):
            os.close(each)
