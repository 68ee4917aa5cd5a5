"""Follow the connection events of a robot with nothing but Zenoh: no line of Engage, as in any other language.

    .venv/bin/engage up --task                           # then, beside it or with its ENDPOINT anywhere:
    .venv/bin/python examples/plain_zenoh_events.py [--robot robot] [--actor human] [--kind directed_gaze] [ENDPOINT]

It needs `eclipse-zenoh` alone. First what is open and how things stand, then each change once as it happens, until
Ctrl-C. docs/connection-events.md says why it is done like this.
"""

import argparse
import json
import queue
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple

import zenoh

GRACE = 2.0
"""Seconds that recognition may be away before its open events are lost: a cut link looks like a death."""
LONGEST_AGE = 60.0
"""Seconds: how far back to ask after a cut."""


class News(NamedTuple):
    """A message as it came. timestamp: Zenoh's; those of one life of recognition are in its order."""

    timestamp: Any
    person: str
    message: dict[str, Any]

    @property
    def life(self) -> str:
        """Of recognition: its events' ids begin so."""
        return self.message["session"] if "session" in self.message else self.message["id"].split("-")[0]


class Changes:
    """Tells each change of each event once and in order, whatever happens to the link. No Zenoh and no clock in here.

    tell: called with each change. deadline: when to call `lose`.
    """

    def __init__(self, tell: Callable[[dict[str, Any]], None], kind: str = "*") -> None:
        self.tell = tell
        self.kind = kind
        self.life = ""
        self.there = False
        self.deadline: float | None = None
        self.open: dict[str, dict[str, Any]] = {}  # by id, as last told
        self.lost: list[dict[str, Any]] = []  # in case they come back
        self.newest: dict[str, Any] = {}  # the last timestamp of each person's news
        self.waiting: list[News] = []

    def came(self, life: str, answers: Iterable[News]) -> None:
        """Recognition is there, or there again. answers: which events are open, and what happened meanwhile."""
        if life != self.life:  # it was started anew, and knows nothing of the events of its former life
            self.lose()
            self.life, self.lost, self.newest = life, [], {}
        self.there, self.deadline = True, None
        for event in self.lost:
            self.change(event)
        self.lost = []
        self.waiting += answers
        self.catch_up()

    def went(self, life: str, now: float) -> None:
        """Recognition is away: it has ended, or a link was cut."""
        if life == self.life:
            self.there, self.deadline = False, now + GRACE

    def lose(self) -> None:
        """It has been away for too long, or for good: nobody will say what becomes of its events."""
        self.deadline = None
        self.catch_up()
        self.lost = list(self.open.values())
        self.open.clear()
        for event in self.lost:
            self.tell({**event, "state": "lost"})

    def hear(self, news: News) -> None:
        """While recognition is away, what comes waits for its answers: they may be older."""
        self.waiting.append(news)
        if self.there:
            self.catch_up()

    def catch_up(self) -> None:
        ours = sorted((news for news in self.waiting if news.life == self.life), key=lambda news: news.timestamp)
        self.waiting = [news for news in self.waiting if news.life != self.life]
        for timestamp, person, message in ours:
            newest = self.newest.get(person)
            if newest is not None and timestamp <= newest:
                continue  # heard and asked for
            self.newest[person] = timestamp
            if message["type"] == "open_events":
                self.compare(person, message.get("events", []))
            else:
                self.change(message)

    def change(self, event: dict[str, Any]) -> None:
        if event["state"] in ("started", "succeeded"):
            self.open[event["id"]] = {key: value for key, value in event.items() if key != "retold"}
        else:
            self.open.pop(event["id"], None)
        self.tell(event)

    def compare(self, person: str, events: Iterable[dict[str, Any]]) -> None:
        """A state says what is open at its timestamp. Usually that is known already."""
        still_open = {event["id"]: event for event in events if self.kind in ("*", event["kind"])}
        for event in list(self.open.values()):
            if person in (event["initiator"], event["responder"]) and event["id"] not in still_open:
                self.change({**event, "state": "lost"})
        for id, event in still_open.items():
            if self.open.get(id) != event:
                self.change(event)


def follow(session: zenoh.Session, robot: str, actor: str, kind: str) -> None:
    recognition = f"{robot}/engage/v1/{{}}/recognition"
    events = f"{recognition.format('evt')}/connection_event/{actor}/{kind}"
    began = time.monotonic()
    samples: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    # Subscribe first and ask then: what happens in between comes twice, and never not at all.
    session.declare_subscriber(events, samples.put)
    session.declare_subscriber(f"{recognition.format('state')}/statistics/{actor}", samples.put)
    token = f"{robot}/engage/v1/@bus/*/alive/robot/recognition/*"
    session.liveliness().declare_subscriber(token, samples.put, history=True)

    changes = Changes(tell_event, kind)
    standing: dict[str, News] = {}  # the newest statistics of each person
    while True:
        left = None if changes.deadline is None else max(0.0, changes.deadline - time.monotonic())
        try:
            sample = samples.get(timeout=left)
        except queue.Empty:
            changes.lose()
            continue
        key = str(sample.key_expr)
        if "/@bus/" not in key:
            if "/statistics/" in key:
                update(standing, news(sample))
            else:
                changes.hear(news(sample))
            continue
        life = key.split("/")[-5][:8]  # .../@bus/<run>/alive/robot/recognition/<clock>
        if sample.kind == zenoh.SampleKind.DELETE:
            changes.went(life, time.monotonic())
            continue
        if life != changes.life:
            standing.clear()
        # What is open before what happened: what happens between the two answers is then the newer.
        answers = ask(session, f"{recognition.format('state')}/open_events/{actor}")
        answers += ask(session, f"{events}?age={min(time.monotonic() - began, LONGEST_AGE)}")
        changes.came(life, answers)
        for each in ask(session, f"{recognition.format('state')}/statistics/{actor}"):
            update(standing, each)


def ask(session: zenoh.Session, selector: str) -> list[News]:
    """All answers. Unless told not to, Zenoh keeps only the newest of each key."""
    while True:
        replies = list(session.get(selector, consolidation=zenoh.ConsolidationMode.NONE))
        answers = [news(reply.ok) for reply in replies if reply.ok is not None]
        if len(answers) == len(replies):
            return answers  # else it timed out: a part would be no answer


def news(sample: zenoh.Sample) -> News:
    _, _, rest = str(sample.key_expr).partition("/recognition/")  # connection_event/<person>/<kind>, .../<person>
    return News(sample.timestamp, rest.split("/")[1], json.loads(sample.payload.to_bytes()))


def update(standing: dict[str, News], statistics: News) -> None:
    """What was asked for may be newer than what waits to be heard."""
    known = standing.get(statistics.person)
    if known is None or statistics.timestamp > known.timestamp:
        standing[statistics.person] = statistics
        tell_statistics(statistics.message)


def tell_event(event: dict[str, Any]) -> None:
    """Fields at their default are left out: a delay that is not known, objects if there are none."""
    about = f" about {', '.join(event['objects'])}" if "objects" in event else ""
    delay = f" after {event['delay']:.2f} s" if "delay" in event else ""
    words = f': "{event["words"]}"' if "words" in event else ""  # of the person; told again when they become known
    print(
        f"{event['id']}: {event['kind']} of {event['initiator']}{about}: {event['state']}{delay}{words}", flush=True
    )


def tell_statistics(statistics: dict[str, Any]) -> None:
    who, count = statistics["actor"] or "all", statistics["session"].get("events", 0)
    print(f"{who}: {statistics.get('level', 'unknown')}, {count} events", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Print the connection events of a robot, and what they amount to.")
    parser.add_argument("endpoint", nargs="?", default="tcp/127.0.0.1:7447")
    parser.add_argument("--robot", default="robot")
    parser.add_argument("--actor", default="*", help="a person's id")
    parser.add_argument("--kind", default="*")
    options = parser.parse_args()
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([options.endpoint]))
    # After a cut of 1 s Zenoh would else take up to 3 s to call again, which is longer than the grace.
    config.insert_json5("connect/retry", json.dumps({"period_init_ms": 100, "period_max_ms": 500}))
    with suppress(KeyboardInterrupt, BrokenPipeError), zenoh.open(config) as session:
        follow(session, options.robot, options.actor, options.kind)
