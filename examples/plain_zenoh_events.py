"""Follow the connection events of a robot with nothing but Zenoh: no line of Engage, as in any other language.

    pip install eclipse-zenoh
    engage up --task                                     # then, beside it or with its ENDPOINT anywhere:
    python examples/plain_zenoh_events.py [--robot robot] [--actor human] [--kind directed_gaze] [ENDPOINT]

First what is open and how things stand, then each change once as it happens, until Ctrl-C. docs/connection-events.md
says why it is done like this.
"""

import argparse
import json
import queue
from contextlib import suppress
from typing import Any

import zenoh


def follow(session: zenoh.Session, robot: str, actor: str, kind: str) -> None:
    recognition = f"{robot}/engage/v1/{{}}/recognition"
    samples: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    # Subscribe first and ask then: what happens in between comes twice, and never not at all.
    session.declare_subscriber(f"{recognition.format('evt')}/connection_event/{actor}/{kind}", samples.put)
    session.declare_subscriber(f"{recognition.format('state')}/statistics/{actor}", samples.put)
    session.liveliness().declare_subscriber(f"{robot}/engage/v1/@bus/*/alive/recognition", samples.put, history=True)

    states: dict[str, zenoh.Sample] = {}
    open_events: dict[str, Any] = {}
    while True:
        sample = samples.get()
        key = str(sample.key_expr)
        if "/@bus/" in key:
            if sample.kind == zenoh.SampleKind.DELETE:  # recognition has gone: the events of this run will never end
                run = key.split("/")[-3][:8]
                for id in [id for id in open_events if id.startswith(f"{run}-")]:
                    tell_event({**open_events.pop(id), "state": "lost"})
                continue
            replies = session.get(f"{recognition.format('state')}/*/{actor}")  # it is there, or there again
            states = {str(reply.ok.key_expr): reply.ok for reply in replies if reply.ok is not None}
            for each in states.values():
                state = json.loads(each.payload.to_bytes())
                if state["type"] == "statistics":
                    tell_statistics(state)
                for event in state.get("events", ()):
                    if kind in ("*", event["kind"]) and open_events.get(event["id"]) != event:
                        open_events[event["id"]] = event
                        tell_event(event)
            continue
        message = json.loads(sample.payload.to_bytes())
        # What a state was told of already has an older timestamp than the state.
        if message["type"] == "statistics":
            known = states.get(key)
        else:
            known = states.get(f"{recognition.format('state')}/open_events/{key.split('/')[-2]}")
        if known is not None and sample.timestamp <= known.timestamp:
            continue
        if message["type"] == "statistics":
            tell_statistics(message)
            continue
        tell_event(message)
        if message["state"] in ("started", "succeeded"):
            open_events[message["id"]] = message
        else:
            open_events.pop(message["id"], None)


def tell_event(event: dict[str, Any]) -> None:
    """Fields at their default are left out: a delay that is not known, objects if there are none."""
    about = f" about {', '.join(event['objects'])}" if "objects" in event else ""
    delay = f" after {event['delay']:.2f} s" if "delay" in event else ""
    print(f"{event['id']}: {event['kind']} of {event['initiator']}{about}: {event['state']}{delay}", flush=True)


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
    with suppress(KeyboardInterrupt, BrokenPipeError), zenoh.open(config) as session:
        follow(session, options.robot, options.actor, options.kind)
