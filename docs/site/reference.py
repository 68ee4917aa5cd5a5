"""The page of the public names: each with signature, docstring and members, read from the source that defines it."""

import ast
import inspect
import re
from collections.abc import Iterable, Iterator
from importlib import import_module

import messages
import msgspec

import engage_hri

HEAD = """\
# Names of the package

What `import engage_hri` promises, and what these return. Made from the code. A type that has no entry here travels on
the bus, and stands on the page of [messages](messages.md).

- `Seconds`, `Degrees`, `Radians`, `Meters`, `Probability`: `float` in that unit; a probability is 0 to 1.
- `Stamp`: an instant on a named clock. `Vector`: three lengths in metres, x ahead of the robot, y to its left, z up.
- Instants without a clock are seconds of this process' clock, as of `Robot.now` and the event loop.

```{py:currentmodule} engage_hri
```
"""
SECTIONS = {
    "Driving a robot": ("connect", "embedded", "Robot"),
    "What you give it": ("TurnFragment", "Reference", "SpeechOption", "Speech", "Gaze", "Pointing", "Head", "Block"),
    "Turns": ("RobotTurn", "TurnAnswer", "HeardTurn", "EndOfTurn"),
    "Conversations led by a model": ("Conversation", "McpServer", "PersonSaid", "RobotSaid"),
    "Telling of people": ("perceive", "PerceivedPerson", "Utterance"),
    "What comes back": (
        "FragmentOutcome", "ConnectionEvent", "Statistics", "Floor", "Interjection", "World", "Entity",
    ),
    "Language models": ("perform_call", "stream", "tool_definition", "summary", "Summary"),
    "Writing a body": (
        "SetPointBody", "SimulatedServos", "OrdinaryBody", "Body", "MovementAuthority", "Arrived", "Reached",
        "JointLimit", "Ray",
    ),
    "Writing a policy of the head, or of turns": ("HeadPolicy", "RobotSign", "TurnPolicy"),
    "What goes wrong": (
        "EngageError", "InputRefused", "RunFailed", "PerformFailed", "RequestRefused", "BehaviorRefused", "Fault",
    ),
}  # fmt: skip
BESIDE = {
    "Turns": (
        "services.client.turn.Sent", "services.client.heard.HeardFeed", "services.client.turn_ends.SoFar",
    ),
    "Conversations led by a model": (
        "services.client.conversation.history.ToolCall", "services.client.conversation.models.Model",
        "services.client.conversation.models.EndpointModel", "services.client.conversation.dialects.ToolForm",
        "services.client.conversation.dialects.TextBit", "services.client.conversation.dialects.CallBit",
        "services.client.conversation.dialects.Finished",
    ),
    "Writing a policy of the head": ("services.generation.head.scene.HeadScene", "schemas.fragments.Claim"),
    "Driving a robot": ("services.client.feeds.Feed", "services.client.feeds.EventFeed"),
    "What comes back": ("schemas.blocks.BlockOutcome", "schemas.recognition.OpenEvents"),
    "Writing a body": (
        "schemas.body.Capabilities", "schemas.body.Estimate", "schemas.body.Phase",
        "services.control.contract.body.BodyState", "services.control.contract.body.Spoke",
        "services.control.contract.body.MouthShape",
        "services.control.voice.synthesis.Synthesizer", "services.control.voice.synthesis.Phrase",
        "services.control.voice.synthesis.Said", "services.control.voice.synthesis.Heard",
        "services.control.voice.synthesis.Phone", "services.control.voice.sounding.SoundingVoice",
        "services.control.voice.synthesis.VoiceSettings",
    ),
    "What goes wrong": ("services.control.contract.body.BodyFailed", "schemas.faults.NoReply"),
}  # fmt: skip
"""What the public names take and return, by its place in the package."""
RAISES = re.compile(r"^Raises:\n((?:    .*(?:\n|$)|\n)+)", re.MULTILINE)
RAISED = re.compile(r"^    (\w+): (.*(?:\n {5,}.*)*)", re.MULTILINE)
SHOWN = {name.rpartition(".")[2] for names in (*SECTIONS.values(), *BESIDE.values()) for name in names}
"""Names of all classes and functions that the page has."""


def page() -> str:
    """Raises LookupError if a public name stands nowhere, or one that is none stands here."""
    listed = [name for names in SECTIONS.values() for name in names]
    if wrong := set(listed) ^ set(engage_hri.__all__):
        raise LookupError(f"docs/site/reference.py: public names that stand nowhere, or are none: {sorted(wrong)}")
    parts = [HEAD]
    for title, names in SECTIONS.items():
        parts += [f"## {title}\n", *(_entry(getattr(engage_hri, name)) for name in names)]
        for place in BESIDE.get(title, ()):
            module, _, name = place.rpartition(".")
            kind = getattr(import_module(f"engage_hri.{module}"), name)
            parts += [_entry(kind, f"Import it from `{kind.__module__}`.\n")]
    return "\n".join(parts)


def _entry(thing: type, where: str = "") -> str:
    (node,) = ast.parse(inspect.getsource(thing)).body
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return _directive("function", _signature(node), _options(node), _function(node), 4)
    assert isinstance(node, ast.ClassDef)
    members = {name: each for part in (*_hidden_bases(thing), node) for name, each in _functions(part).items()}
    making = members.get("__init__")
    is_made_by_users = making is not None and ast.get_docstring(making) is not None
    signature = _signature(making).replace("__init__", node.name) if is_made_by_users else node.name
    body = [*_bases(thing), where, *(_struct(thing) if issubclass(thing, msgspec.Struct) else _plain(thing))]
    if is_made_by_users:
        body += ["", _function(making)]
    body += ["", *(_member(each) for name, each in members.items() if not name.startswith("_"))]
    kind = "exception" if issubclass(thing, BaseException) else "class"
    return _directive(kind, signature.replace(" -> None", ""), (), "\n".join(body), 5)


def _functions(node: ast.ClassDef) -> dict[str, ast.FunctionDef | ast.AsyncFunctionDef]:
    return {each.name: each for each in node.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)}


def _hidden_bases(thing: type) -> list[ast.ClassDef]:
    """Bases that stand nowhere on the page, the most general first: what they have is told as the class' own."""
    hidden = [base for base in reversed(thing.__mro__[1:]) if _is_ours(base) and base.__name__ not in SHOWN]
    nodes = [node for base in hidden for node in ast.parse(inspect.getsource(base)).body]
    return [node for node in nodes if isinstance(node, ast.ClassDef)]


def _is_ours(base: type) -> bool:
    return base.__module__.startswith("engage_hri")


def _bases(thing: type) -> list[str]:
    ours = [f"`{base.__name__}`" for base in thing.__bases__ if _is_ours(base) and base.__name__ in SHOWN]
    return [f"Is a {', '.join(ours)}.\n"] if ours and not issubclass(thing, msgspec.Struct) else []


def _plain(thing: type) -> list[str]:
    """Of a class that is no struct: what it says, and its attributes."""
    attributes = (*vars(thing).get("__annotations__", ()), "points", "pace", "revoked", "outcome", "block")
    prose, meanings = messages.meanings_of(inspect.cleandoc(thing.__doc__ or ""), attributes)
    return [prose, "", *(f"- `{name}`: {said}" for name, said in meanings.items())]


def _struct(thing: type) -> list[str]:
    rows, prose = [], ""
    for base in _structs(thing):
        prose, meanings = messages.meanings_of(inspect.cleandoc(base.__doc__ or ""), base.__struct_fields__)
        rows += messages.field_rows(base, meanings, "messages.md")
    return [prose, "", "| field | type | default | |", "|---|---|---|---|", *rows]


def _structs(thing: type) -> list[type]:
    """Whose fields it has, the most general first."""
    return [
        base for base in reversed(thing.__mro__) if issubclass(base, msgspec.Struct) and base is not msgspec.Struct
    ]


def _member(node: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    kind = "property" if "property" in _marks(node) else "method"
    return _directive(kind, _signature(node), _options(node), _function(node), 4)


def _marks(node: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    return [ast.unparse(mark) for mark in node.decorator_list]


def _function(node: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    doc = ast.get_docstring(node) or ""
    names = tuple(each.arg for each in (*node.args.args, *node.args.kwonlyargs) if each.arg not in ("self", "cls"))
    raises = RAISES.search(doc)
    prose, meanings = messages.meanings_of(RAISES.sub("", doc).strip(), names)
    told = [prose]
    if "asynccontextmanager" in _marks(node):
        told.append("\nUse it with `async with`.")
    told += ["", *(f":param {name}: {said}" for name, said in meanings.items())]
    for found in RAISED.finditer(raises[1]) if raises else ():
        told.append(f":raises {found[1]}: {' '.join(found[2].split())}")
    return "\n".join(told)


def _signature(node: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    own = node.args
    own.args = [each for each in own.args if each.arg not in ("self", "cls")]
    if "property" in _marks(node):
        return node.name
    returned = ast.unparse(node.returns).replace("'Robot'", "Robot") if node.returns else ""
    return f"{node.name}({ast.unparse(own)})" + (f" -> {returned}" if returned else "")


def _directive(kind: str, signature: str, options: Iterable[str], body: str, colons: int) -> str:
    return "\n".join([f"{':' * colons}{{py:{kind}}} {signature}", *options, "", body, ":" * colons, ""])


def _options(node: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[str]:
    marks = _marks(node)
    if isinstance(node, ast.AsyncFunctionDef) and "asynccontextmanager" not in marks:
        yield ":async:"
    if "abstractmethod" in marks:
        yield ":abstractmethod:"
    if "classmethod" in marks:
        yield ":classmethod:"
    if "property" in marks and node.returns:
        yield f":type: {ast.unparse(node.returns)}"
