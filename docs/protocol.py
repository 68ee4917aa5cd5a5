"""Write docs/protocol.md from schemas/: `python docs/protocol.py`. tests/schemas/test_protocol.py checks it.

The prose and the table of keys stand here; messages and fields are read from the code, with their strings.
"""

import ast
import inspect
import re
import sys
from pathlib import Path
from textwrap import dedent
from types import ModuleType

import msgspec

from engage_hri.schemas import (
    actions,
    attention,
    behaviors,
    blocks,
    body,
    faults,
    feedback,
    fragments,
    keys,
    perception,
    presence,
    recognition,
    requests,
    status,
    units,
    world,
)
from engage_hri.schemas.messages import COMMANDS, OUTWARD
from engage_hri.services.bus.zenoh.order import KEPT
from engage_hri.services.requests.serving import LIFELESS_KEPT

ROLES = ", ".join(f"`{role}`" for role in keys.ROLES)
PAGE = Path(__file__).parent / "protocol.md"


def _taken(key: str) -> str:
    return ", ".join(f"`{kind.__name__}`" for kind in COMMANDS[key])


def _address(expression: str) -> str:
    """The key of a command, with names for what a requester puts in."""
    return expression.replace("*/*", "<role>/<requester>")


KEYS: tuple[tuple[str, str, str], ...] = (
    (_address(keys.FRAGMENT), "manager → generation", _taken(keys.FRAGMENT)),
    (_address(keys.INHIBIT), "anyone → generation", _taken(keys.INHIBIT)),
    (_address(keys.BLOCK), "manager, generation → realizer", _taken(keys.BLOCK)),
    (_address(keys.EVENT), "realizer → recognition", _taken(keys.EVENT)),
    (_address(keys.TURN), "realizer, generation → recognition", _taken(keys.TURN)),
    (_address(keys.BEHAVIOR), "realizer → control", _taken(keys.BEHAVIOR)),
    (_address(keys.cancel("<server>")), "requester → the request's server", "`Cancel`"),
    (_address(keys.keep_alive("<server>")), "requester → the server of its live requests", "`KeepAlive`"),
    (
        keys.request_state("<server>"),
        "server → requester",
        "`Heard`, `Accepted`, `Outdated`, `Refused`; from generation `FragmentOutcome`, `InhibitionEnded`; from the"
        " realizer `BlockOutcome`, `BehaviorInterrupted`; from control `BehaviorOutcome`, `BehaviorAborted`,"
        " `HomeReached`; from recognition `EventOutcome`, `TurnOutcome`",
    ),
    (
        keys.FEEDBACK,
        "realizer → all",
        "`BlockProgress`, `SyncPointProgress`, `PredictionFeedback`, `WarningFeedback`",
    ),
    (keys.FRAGMENT_FEEDBACK, "generation → all", "`WarningFeedback`: what was refused, or done otherwise than asked"),
    (keys.TURN_CLOSED, "generation → all", "`TurnClosed`"),
    (keys.SYNC_POINT, "control → realizer", "`SyncPointArrived`, `SyncPointReached`, `WordSpoken`"),
    (keys.ROBOT_ACTION, "control → recognition", "`ActionBegan`, `ActionEnded`"),
    (
        keys.PERCEIVED_ACTION,
        "perception → recognition",
        "`ActionBegan`, `ActionEnded`, `ActorFound`, `ActorLost`",
    ),
    (
        keys.RECOGNIZED_ACTION,
        "recognition → all",
        "the same, made from raw perception where perception does not say it itself",
    ),
    (
        keys.connection_event("<person>", "<kind>"),
        "recognition → all",
        "`ConnectionEvent`, whoever began it; kind: `directed_gaze`, `mutual_facial_gaze`, `adjacency_pair` or"
        " `backchannel`",
    ),
    (
        keys.fault("<service>"),
        "any service → all",
        "`Fault`: a bad message, or what went wrong at the edge; the server of a command that is none gets it as"
        " `Unreadable`, which is never sent",
    ),
    (keys.WORLD, "perception → all", "`World`"),
    (keys.HEAD_OWNER, "generation → all", "`HeadOwner`"),
    (
        keys.open_events("<person>"),
        "recognition → all",
        "`OpenEvents`, for those who come late ([connection-events.md](connection-events.md))",
    ),
    (keys.statistics("<actor>"), "recognition → all", "`Statistics`, one per person, and `all`"),
    (keys.ROBOT_STATE, "control → all", "`RobotState`"),
    (keys.head_pose("<person>"), "perception → recognition", "`HeadPose`, some 10 to 30 times a second"),
    (keys.voice_activity("<person>"), "perception → recognition", "`VoiceActivity`, as often"),
    (keys.ESTIMATE, "generation, realizer ask control", "`EstimateBehaviors`, answered with `Estimates`"),
    (keys.DESCRIBE, "anyone asks control", "`DescribeBody`, answered with `Capabilities`"),
    (keys.status("<participant>"), "anyone asks a service", "`AskStatus`, answered with `Status`"),
    (keys.alive("<participant>"), "the bus itself", "`PeerAlive`, `PeerGone`: made from liveliness, never sent"),
)

MODULES: tuple[ModuleType, ...] = (
    fragments, blocks, behaviors, feedback, recognition, attention, actions, perception, world, body, requests,
    faults, presence, status, units,
)  # fmt: skip

HEAD = f"""\
# Protocol

Everything that services say to one another, and what any other program needs to take part. The structs are in
`schemas/`; as JSON Schemas in `schemas/exported/`, one file per message. This page is made from the code:
`.venv/bin/python docs/protocol.py`.

## Keys

`<robot>/{keys.PREFIX}/<class>/<producer or server>/<subject>`, where `<robot>` is the deployment's namespace (default
`robot`) and the number is the major version of the protocol. The class says how a key travels:

| class | for | how |
|---|---|---|
| `cmd` | requests to a server | each, in order; a late subscriber gets the last {keys.HISTORY_MAX_AGE:g} s; idempotent by id |
| `evt` | request states, feedback, sync points, actions, connection events, faults | as `cmd` |
| `state` | world, statistics, open events, owner of the head | the last value, also for a late subscriber |
| `stream` | the robot's posture | the newest only; may be dropped |
| `rpc` | short questions | a Zenoh query; no reply within its timeout is a failure |
| `alive` | who is there | liveliness tokens |

KEYS
Chunks that begin with `@` under the prefix are the bus' own bookkeeping (order, history, clocks); no wildcard
includes them.

## Payloads

Engage sends MessagePack, and JSON where programs of others read most: OUTWARD. It
understands both everywhere. The encoding of a sample names form, message and major version:
`application/msgpack;engage.SyncPointReached/1`, `application/json;engage.PerformFragment/1`; the part after `;` may be
missing. Another major version is refused by name. A payload is one struct; its field `type` says which. Fields at
their default are left out. Unknown fields are ignored on the bus (a newer peer may send them).

Where blocks and fragments go, `application/xml` may stand for BML or EBML; the id of the request is then that of the
block or fragment.

- Instants are `[clock, seconds]` (`Stamp`): seconds on a named monotonic clock. Instants of different clocks compare
  only through an estimated offset; durations are plain seconds.
- Lengths are metres, x ahead of the robot, y to its left, z up, origin on the floor below the robot. Angles are
  radians unless the type says `Degrees`.
- An actor's id as a target stands for its face.

## Requests

A command travels on `<robot>/{keys.PREFIX}/cmd/<server>/<role>/<requester>/<subject>`. The role is one of {ROLES}; rules
for access are given by it. The requester is a name of its own making, unique on the robot's bus; a process with a
liveliness token has its participant's name.

A request is known by its requester, the requester's life, its kind (`type`) and its `id`, and an answer names all four.
Among the live requests of one life no two have the same id, of whatever kind: the second is refused by name. `life` is a
word that a program makes up at each start, so that it never gets what its former life had asked for. Who leaves it out
gets one from its connection, where Zenoh tells (a source info, or a timestamp of its own); else its ended requests are
remembered for {LIFELESS_KEPT:g} s, and then, or with other content, the same id is a new request.

It ends exactly once: `Refused`, or `Accepted` and then one outcome. Send it again (after 0.3 s, doubling to 2 s) until
one of these has come; the server repeats its last state, and says `Heard` while there is none. Same life and id, same
request: nothing is done twice. Other content under the id of a live request replaces it where its kind says so
(`PerformBehavior`, `Inhibit`), and is ignored with a `Fault` else. `Cancel` ends it as interrupted; it is sent again
until the outcome has come.

What was accepted is not sent again. Where a request names a `lease` (an `Inhibit`: its `ttl`), it must be renewed within so
many seconds: by being sent again, or by a `KeepAlive` that names it with all others (Engage's own once a second, leases of
5 s); else the server ends it. The lease of a `PerformBehavior` is that of the movement authority. `live` is a list of
lists, of kind, id, revision, authority (`through` of a `PerformBehavior`, else empty) and seconds from `at`; a clock that
nobody knows reads as now:

```text
{{"type": "keep_alive", "life": "7", "at": ["mine", 0], "live": [["perform_fragment", "greeting-1", 0, "", 5.0]]}}
```

`Outdated` answers a `KeepAlive` that speaks of newer content than the server has, of a kind that can be changed; `Refused`
one that names what the server does not know; the outcome, one that names what has ended.

- The id of the request is what counts here. Fragments and blocks have ids of their own, which nobody else's live fragment
  or block may have.
- With a life, an id is spent when its request has ended or was refused: the same again is answered with the same, other
  content too, and a `Fault` says so. A corrected request needs another id.
- Content of the same or a higher `revision` replaces what is there; count it up.
- `Cancel` names the life of what it cancels. One that comes before its request refuses that.
- A payload that is none is answered with `Refused` if its id can be read, and with a `Fault` in any case.
- The token of a participant is `<robot>/{keys.own("<run>", "alive/<name>")}`, with a run of its own making.

When the requester's liveliness token stays away for 2 s, or comes back as another life, the server ends its requests. A
requester without a token and without a lease is left alone, but by control.

## Speaking it from elsewhere

Any language with Zenoh can play a fragment. In Python, without a line of Engage:

```python
import json, zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
with zenoh.open(config) as session:
    states = session.declare_subscriber("robot/{keys.request_state("generation")}")
    session.put(
        "robot/{keys.command(keys.FRAGMENT, "manager", "my-manager")}",
        json.dumps({{
            "type": "perform_fragment",
            "id": "greeting-1",
            "fragment": {{
                "type": "fragment",
                "id": "greeting-1",
                "turn_status": "full",
                "behaviors": [{{"type": "speech", "id": "speech-1", "text": "Hello there."}}],
            }},
        }}),
        encoding="application/json;engage.PerformFragment/1",
    )
    for sample in states:
        print(sample.encoding, sample.payload.to_bytes())
```

What is published comes as MessagePack, but for those named above. `mode` `client` suits a visitor: Zenoh forwards it
everything through the one it connects to.

A subscriber of Zenoh hears what is said from now on. What was said before, every process hands out to an ordinary
query, as it was published: same encoding, attachment and timestamp.

| `session.get` of | brings |
|---|---|
| `<robot>/{keys.of_class("state")}` | the last value of every state, from each process that is there |
| `<robot>/{keys.of_class("evt")}`, `<robot>/{keys.of_class("cmd")}`, or any part of them | the last {keys.HISTORY_MAX_AGE:g} s, of each process in its order |

- Parameters of the selector, joined by `;`: `format=json` for JSON whatever it was published in, or `format=msgpack`; `age=60` for the events and
  commands of the last 60 s (a process keeps its last {KEPT}).
- Pass `consolidation=zenoh.ConsolidationMode.NONE` for events and commands: by default Zenoh keeps only the newest
  reply of each key, which is right for states alone.
- To miss nothing, subscribe first and then ask; what comes twice has the same timestamp. Sort by timestamp for one order
  over all processes.
- Short questions (`rpc`) are queries with a payload. Asked in JSON, or with `format=json`, they are answered in JSON. A
  refusal is an error reply that holds a `Fault`. `<robot>/{keys.status("*")}?format=json` needs no payload and asks all
  services how they are.

```python
import json, zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
with zenoh.open(config) as session:
    for reply in session.get("robot/{keys.of_class("state")}?format=json"):
        if reply.ok:
            print(reply.ok.key_expr, json.loads(reply.ok.payload.to_bytes()))
```

## Blocks and fragments in files

`engage play` and `read` of `schemas/documents/json_codec.py` take XML or JSON; a JSON file may hold an array of several. An object with
`parts` is what a language model writes (docs/language-models.md, `perform_turn_fragment.tool.json`). In JSON else the
form is that of `TurnFragment` and `Block` below; `type` may be left out where the content makes it plain, and an
unknown key is refused. In XML:

- a block is `<bml>` in the namespace `org.mindmakers.bml` (the thesis' draft), in none, or in that of BML 1.0;
- a turn fragment is `<ebml:ebml xmlns:ebml="edu.wpi.ebml">` around the same elements, with the attributes `turnIndex`,
  `turnStatus`, `addressee`, `delay`, `delayTarget`, `accept` (separated by spaces), and with
  `<ebml:reference target minReliability>` of `<speechOption text cost deictic>` of `<distractor object>`, or with
  `propose="true"` of none (in JSON: without `options`);
- connection events inside a block are `<ebml:event kind responder cause optional accept limit turn>` with
  `<ebml:object id>` and `<ebml:anchor ref>`; what becomes of a turn is `<ebml:turn turn signal actor>`;
- marks of a speech are `<sync id>`, `<sync ref>`, `<tm id>` or `<mark name>`; other elements inside its text are
  prosodic markup for the voice;
- attributes and elements of other namespaces are ignored; there are no entities and no DTD; at most 4 MiB, 64 levels.

Which elements and attributes of BML are understood in which dialect, and what becomes of the rest: docs/bml.md.

Sync references: `[block:]behavior:sync[:n][±seconds]`, `[block:]seconds`, `bml:start`; details in `schemas/syncref.py`.
Whatever is wrong with a fragment refuses it whole, before anything moves, with file, line (XML) or path (JSON), reason
and advice. Of a block, what cannot be realized is left out with a warning (docs/bml.md), the rest runs.

## JSON lines

`--feedback FILE` and `--events FILE` (of `engage demo`, `up` and `play`) write one JSON object per line; `engage watch
--json` prints all kinds. A line is its message (below) as JSON, with the same keys and values, but

- every key is always there, also where the message on the bus leaves it out because it is at its default;
- an instant, on the bus `[clock, seconds]`, is a number: the seconds of the bus clock;
- seconds are rounded to microseconds.

JSON Schema: `schemas/exported/lines.json`.

| stream | `type` | message |
|---|---|---|
| feedback | `block_progress` | [`BlockProgress`](#blockprogress--block_progress) |
| feedback | `sync_point_progress` | [`SyncPointProgress`](#syncpointprogress--sync_point_progress) |
| feedback | `warning` | [`WarningFeedback`](#warningfeedback--warning) |
| `engage watch --json` only | `prediction` | [`PredictionFeedback`](#predictionfeedback--prediction) |
| events | `connection_event` | [`ConnectionEvent`](#connectionevent--connection_event) |
| `engage watch --json` only | `statistics` | [`Statistics`](#statistics--statistics) |
| `engage watch --json` only | `head_owner` | [`HeadOwner`](#headowner--head_owner) |
| `engage watch --json` only | `fault` | [`Fault`](#fault--fault) |

## Messages

"""  # noqa: E501


def page() -> str:
    head = HEAD.replace("KEYS\n", _key_table(), 1).replace("OUTWARD", _outward(), 1)
    return head + "\n".join(_module(module) for module in MODULES)


def _outward() -> str:
    *most, last = (f"`{kind.__name__}`" for kind in OUTWARD)
    return f"{', '.join(most)} and {last}"


def _key_table() -> str:
    rows = [f"| `{key}` | {way} | {messages} |" for key, way, messages in KEYS]
    return "\n".join(["| key | from → to | messages |", "|---|---|---|", *rows, "", ""])


def _module(module: ModuleType) -> str:
    tree = ast.parse(inspect.getsource(module))
    title = module.__name__.rpartition(".")[2]
    parts = [f"### {title}", "", inspect.cleandoc(module.__doc__ or ""), ""]
    parts += [part for node in tree.body if isinstance(node, ast.ClassDef) for part in _struct(module, node)]
    if aliases := [
        _alias(node, following) for node, following in zip(tree.body, [*tree.body[1:], None], strict=True)
    ]:
        parts += [line for line in aliases if line]
    return "\n".join(parts).rstrip() + "\n"


def _struct(module: ModuleType, node: ast.ClassDef) -> list[str]:
    kind = getattr(module, node.name)
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        return []
    tag = kind.__struct_config__.tag
    parts = [f"#### {node.name}" + (f" · `{tag}`" if tag else ""), ""]
    prose, meanings = _meanings(ast.get_docstring(node) or "", kind.__struct_fields__)
    if prose:
        parts += [prose, ""]
    if rows := _rows(kind, meanings):
        parts += ["| field | type | default | |", "|---|---|---|---|", *rows, ""]
    bases = [base.__name__ for base in kind.__bases__ if base is not msgspec.Struct and base.__struct_fields__]
    if bases:
        parts += [f"And the fields of `{bases[0]}`.", ""]
    return parts


def _meanings(text: str, fields: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """A docstring apart: prose, and what it says about fields (`name: meaning`, beginning a line or sentence)."""
    if not fields:
        return text, {}
    names = "|".join(fields)
    heading = re.compile(rf"(?:^|(?<=\. ))((?:{names})(?:, (?:{names}))*): ", re.MULTILINE)
    pieces = heading.split(text)
    found: dict[str, str] = {}
    prose = pieces[0]
    for heads, meaning in zip(pieces[1::2], pieces[2::2], strict=True):
        said, _, after = meaning.partition("\n\n")
        found |= {name: " ".join(said.split()) for name in heads.split(", ")}
        prose += after and f"\n{after}"
    return prose.strip(), found


def _rows(owner: type, meanings: dict[str, str]) -> list[str]:
    (node,) = ast.parse(dedent(inspect.getsource(owner))).body
    assert isinstance(node, ast.ClassDef)
    rows = []
    for field, following in zip(node.body, [*node.body[1:], None], strict=True):
        is_field = isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if not is_field or field.target.id not in owner.__struct_fields__:
            continue
        kind = ast.unparse(field.annotation).replace("|", "\\|")
        default = "" if field.value is None else f"`{ast.unparse(field.value)}`"
        name = field.target.id
        meaning = " ".join(filter(None, [meanings.get(name), _said(following)])).replace("|", "\\|")
        rows.append(f"| `{name}` | `{kind}` | {default} | {meaning} |")
    return rows


def _said(node: ast.stmt | None) -> str:
    """The string that stands below a field."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return " ".join(node.value.value.split())
    return ""


def _alias(node: ast.stmt, following: ast.stmt | None) -> str:
    """A named type of the module: `Hand = Literal[...]`."""
    if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
        return ""
    said = _said(following)
    return f"- `{node.targets[0].id}` = `{' '.join(ast.unparse(node.value).split())}`" + (f": {said}" if said else "")


def main() -> int:
    fresh = page()
    if "--check" in sys.argv[1:]:
        return 0 if PAGE.read_text(encoding="utf-8") == fresh else 1
    PAGE.write_text(fresh, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
