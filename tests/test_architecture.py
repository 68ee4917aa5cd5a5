"""The rules of the house, as failing checks: who may import what, how long a file may get, what no file may hold.

`violations` judges one file from its path and text alone; the tests show each rule catching a small sample, and
then hold every tracked file to it.
"""

import ast
import re
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from functools import cache, lru_cache
from math import inf
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import pytest

from tests.shells import SHELLS

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 600
"""Lines."""
CODE = ("engage_hri", "schemas", "services", "examples", "benchmarks", "tests")

IMPURE = {"asyncio", "zenoh", "time", "random", "logging", "datetime", "socket", "subprocess"}
"""What values-in-values-out code has no use for: the loop, the wire, the clock, chance, talking to the console."""
MACHINERY = {"bus", "requests", "runtime", "client", "commandline"}
"""Packages of `services` that pure files don't know either; their own pure files aside."""
PURE_MACHINERY = {
    "services/requests/asking.py", "services/requests/asking_table.py",
    "services/requests/serving.py", "services/requests/serving_table.py",
    "services/runtime/intake.py", "services/runtime/installation.py",
    "services/runtime/parcels.py",
    "services/runtime/steps.py",
    "services/client/chunking.py", "services/client/event_stream.py", "services/client/turn_ends.py",
    "services/client/conversation/calls.py", "services/client/conversation/dialects.py",
    "services/client/conversation/history.py", "services/client/conversation/wire.py",
    "services/client/people/actions.py",
    "services/client/people/shared_world.py", "services/bus/deadlines.py", "services/bus/samples.py",
}  # fmt: skip
"""Files of these packages that are pure themselves."""
VISITOR = "examples/plain_zenoh_events.py"
"""Shows how to do without Engage: it may import nothing of it."""
COMPOSERS = {"commandline"}
"""Packages of `services` that are no service: they put services together and may import all of them."""
SHARED = {"bus", "requests", "runtime", "client", "frameworks", "tangram", "recording", "reports", "text", "web"}
"""Packages of `services` that are no service, and that services may import."""
PURE_SHARED = {"recording", "reports", "tangram", "text"}
"""Those of them whose files are pure, as those of a service are."""
KNOW_TANGRAM = (
    "services/tangram/", "services/control/mujoco/", "services/commandline/shell/config.py",
    "services/commandline/embedding.py",
)  # fmt: skip
"""The example itself, the physics whose room has its table, its sections of a configuration, and `embedded`.
The core knows no tangram: docs/decisions/0145."""
LAYERS = {
    "schemas": "documents > *",
    "services": "commandline > console control door doctor generation perception realizer recognition study"
    " > tangram"
    " > simulation > frameworks > client > recording > reports requests > web > runtime > bus > text",
    "services/web": "links serving > guard outbox > https tokens",
    "services/frameworks": "livekit pipecat realtime > written_turn",
    "services/door": "service > server > openapi > operations speaking > config",
    "services/text": "ear own_words > marks > patterns > calling ends listening",
    "services/bus": "memory zenoh > certificates > interface > subscription > samples > config deadlines journal"
    " keyring",
    "services/control": "mujoco reachy_mini torso > figure service testing > bases calibrating serving voice"
    " > contract > config motion",
    "services/perception": "testing > pieces > eyes hearing > attached child offered pictures sense_faults",
    "services/perception/eyes": "service > pages > people seat > watching > sources > placing seeing"
    " > nodding tracking > camera head_pose one_euro > looking > config",
    "services/perception/pieces": "service > watching > keeping sources > finding > hands > spotting"
    " > colors > config",
    "services/perception/hearing": "service > device pages > intake > speeches"
    " > company listening microphone own_voice recognizers smart_turn > lips turn_detectors > recognizing sound"
    " > voice > config",
    "services/commandline": "look robot study talk > app bodies embedding > shell",
    "services/client": "conversation > language_models > robot > heard turn > known_objects outcomes > performing"
    " > orders > feeds people > chunking event_stream inputs turn_ends",
    "services/generation": "service > intake > fragments policies > performance > acts > fragment_check pipeline"
    " > block exchange head > references turns > followed inhibitions > config",
    "services/realizer": "service > perform > export together > report > decide > foresee > plan > net"
    " > config points",
    "services/recognition": "service > intake > recognizer > perceive statistics > events > config",
}
"""What lies above what within a folder: its files and folders by name, `*` for all others. Each may import what
stands further right, and nothing beside it or further left."""
_RANKS = [
    (
        folder,
        tuple(folder.split("/")),
        {name: rank for rank, names in enumerate(it.split(">")) for name in names.split()},
    )
    for folder, it in LAYERS.items()
]
"""Each of these folders, its parts, and the layer of each name in it."""
ON_A_ROBOT = {"realizer", "generation", "recognition", "control"}
THREADS = {"threading", "_thread", "concurrent", "multiprocessing"}
THREAD_CALLS = {"to_thread", "run_in_executor", "Thread", "ThreadPoolExecutor"}

WEB = {"starlette", "uvicorn"}
WITH_WEB = {
    *(f"services/console/web/{name}.py" for name in ("server", "links", "sights", "sounds")),
    "services/web/links.py", "services/web/serving.py", "services/door/server.py",
}  # fmt: skip
"""The only files with a web stack. They are the exception to "no threads": it reads the files of the page on worker
threads, which touch nothing of ours; pages, frames and orders stay on the one loop."""

NO_SUBJECTS = re.compile(
    "(Its?|Who|Whose|Whom|What|Which|How|When|Where|Whether|Why|Of|Is|Has|Have|Does|Do|Did|Are|May|Can|Could|Was|Were|Will"
    "|As|From|To|In|On|At|By|Under|(No|Some|Every)body|Those|That|This|These|They|There|Here|And|Or|But|So|If|Once|Only"
    "|Also|Rather|Without|Until|Between)\\b"
)
"""Words that a docstring does not begin with: a stranger does not know what they speak of."""

MACHINE_PATH = re.compile(r"(?<![\w./}$-])/(?:work|home|Users|root|mnt|opt)/\w+")
INDEX_ADDRESS = re.compile(
    r"--(?:extra-)?index-url|--find-links|(?:https?|file)://[^\s\"'<>]+/simple\b|https?://\d+\.\d+\.\d+\.\d+[^\s]*/pypi"
)


def violations(path: str, text: str) -> list[str]:
    """What file `path` (relative, with slashes) breaks, in words."""
    found = list(_in_any_text(path, text))
    place = PurePosixPath(path)
    if place.suffix == ".py" and place.parts[0] in CODE:
        tree = _tree(text)
        found += _in_code(place, text, tree)
        if place.parts[0] == "tests":
            found += _in_tests(place, text, tree)
    return [f"{path}: {violation}" for violation in found]


def _in_any_text(path: str, text: str) -> Iterator[str]:
    if path == "tests/test_architecture.py":
        return  # the samples below
    for number, line in enumerate(text.splitlines(), 1):
        if MACHINE_PATH.search(line):
            yield f"line {number} holds a path of somebody's machine"
        if INDEX_ADDRESS.search(line):
            yield f"line {number} holds the address of a package index"


def _in_code(place: PurePosixPath, text: str, tree: ast.Module) -> Iterator[str]:
    lines = text.count("\n")
    if lines > LONGEST:
        yield f"{lines} lines, at most {LONGEST}"
    for module in _imported(place, tree):
        if module.split(".")[0] in ("schemas", "services"):
            yield f"imports {module}: its name is engage_hri.{module}"
    for module in _imports(place, tree):
        yield from (f"imports {module}: {reason}" for reason in _import(place, module))
    if place.parts[0] in ("schemas", "services", "engage_hri"):
        yield from _docstrings(tree)
    if place.parts[0] in ("schemas", "services"):
        for name in _called(tree) & THREAD_CALLS:
            yield f"calls {name}: this code starts no threads"
    if place.parts[0] != "tests" and str(place) not in ("schemas/keys.py", VISITOR):
        for node in _nodes(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "engage/v1" in node.value:
                yield f"line {node.lineno} spells a key expression: schemas/keys.py has them all"


def _docstrings(tree: ast.Module) -> Iterator[str]:
    for node in _nodes(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first, *_ = (ast.get_docstring(node) or "-").splitlines()
            if NO_SUBJECTS.match(first) or first.rstrip().endswith("?"):
                yield f"{first!r} does not begin with a noun or a verb"


def _import(place: PurePosixPath, module: str) -> Iterator[str]:
    """Why `place` may not import `module`."""
    top = place.parts[0]
    if str(place) == VISITOR and module.split(".")[0] in ("schemas", "services"):
        yield "it shows how to do without"
    package = place.parts[1] if top == "services" and len(place.parts) > 2 else ""
    first, second = [*module.split("."), ""][:2]
    measures = top in ("tests", "benchmarks")
    visits = measures or str(place) == VISITOR
    if first == "zenoh" and not visits and place.parts[:3] != ("services", "bus", "zenoh"):
        yield "only services/bus/zenoh may"
    if first in THREADS and not measures:
        yield "this code starts no threads"
    if first in WEB and str(place) not in WITH_WEB:
        yield "the web stack has threads, and is for the window's server alone"
    if top == "schemas" and first == "services":
        yield "the vocabulary knows no service"
    machinery = first == "services" and second in MACHINERY and not _is_in(module, PURE_MACHINERY)
    if _is_pure(place) and (first in IMPURE or machinery):
        yield "this file is pure"
    elsewhere = first == "services" and second not in ("", package) and (ROOT / "services" / second).is_dir()
    if package and package not in COMPOSERS | SHARED and elsewhere and second not in SHARED:
        yield "services do not import one another"
    if package and module.startswith("services.tangram") and not str(place).startswith(KNOW_TANGRAM):
        yield "the core knows no tangram"
    yield from _layering(place, module)
    if package in ON_A_ROBOT and module.startswith("services.simulation"):
        yield "simulation has no business on a robot"


def _layering(place: PurePosixPath, module: str) -> Iterator[str]:
    """Where that goes up, or beside, in the folder that holds both."""
    here, there = place.with_suffix("").parts, tuple(module.split("."))
    for folder, root, rank in _RANKS:
        if here[: len(root)] != root or here[len(root)] in ("__init__", "__main__"):
            continue
        ours = here[len(root)] if "*" not in rank or here[len(root)] in rank else "*"
        if ours not in rank:
            yield f"{ours} has no place in the layers of {folder}"
        elif there[: len(root)] == root and len(there) > len(root) and there[len(root)] != ours:
            theirs = there[len(root)] if there[len(root)] in rank else "*"
            if theirs != ours and rank.get(theirs, inf) <= rank[ours]:
                yield f"{theirs} is not below {ours} in {folder}"


def _is_in(module: str, files: set[str]) -> bool:
    """Is it one of these files, or something of one?"""
    parts = module.split(".")
    return any("/".join(parts[:end]) + ".py" in files for end in (len(parts), len(parts) - 1))


def _is_pure(place: PurePosixPath) -> bool:
    if place.parts[0] == "schemas" or str(place) in PURE_MACHINERY:
        return True
    return (
        place.parts[0] == "services"
        and len(place.parts) > 2
        and place.parts[1] not in COMPOSERS | (SHARED - PURE_SHARED)
        and place.name != "service.py"
        and "testing" not in place.parts  # tests that are installed
        and str(place) not in SHELLS
    )


def _in_tests(place: PurePosixPath, text: str, tree: ast.Module) -> Iterator[str]:
    if "time.sleep" in set(_imports(place, tree)):
        yield "imports time.sleep: wait for something"
    for line in _sleeps(tree, "time.sleep"):
        yield f"line {line} sleeps on the wall clock: wait for something"
    if "real_time" not in text:
        return
    whole_file = any("real_time" in ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign))
    functions = (node for node in _nodes(tree) if isinstance(node, ast.AsyncFunctionDef | ast.FunctionDef))
    for function in functions:
        if any(_sleeps(function, "asyncio.sleep")):
            real = whole_file or any("real_time" in ast.unparse(mark) for mark in function.decorator_list)
            for line in _sleeps(function, "asyncio.sleep") if real else ():
                yield f"line {line} sleeps on the wall clock: wait for something"


def _sleeps(tree: ast.AST, name: str) -> Iterator[int]:
    """Lines of calls that really wait; `sleep(0)` only lets others run."""
    for node in _nodes(tree) if isinstance(tree, ast.Module) else ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "sleep"):
            continue
        if ast.unparse(node.func) == name and ast.unparse(node.args[0]) not in ("0", "0.0"):
            yield node.lineno


def _imports(place: PurePosixPath, tree: ast.Module) -> Iterator[str]:
    """Every module that is imported anywhere in the file, `from a import b` as both a and a.b.

    Ours by their place in the tree: `services.bus`, not `services/bus.py`.
    """
    yield from (module.removeprefix("engage_hri.") for module in _imported(place, tree))


def _imported(place: PurePosixPath, tree: ast.Module) -> Iterator[str]:
    for node in _import_statements(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            base = place.parent.parts[: len(place.parent.parts) - node.level + 1] if node.level else ()
            module = ".".join([*base, *filter(None, [node.module])])
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


@lru_cache(maxsize=1)
def _tree(text: str) -> ast.Module:
    return ast.parse(text)


@lru_cache(maxsize=1)
def _import_statements(tree: ast.Module) -> list[ast.Import | ast.ImportFrom]:
    return [node for node in _nodes(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


@lru_cache(maxsize=1)
def _nodes(tree: ast.Module) -> list[ast.AST]:
    """All nodes of a file, for which most rules ask one after the other."""
    return _below(tree)


def _below(top: ast.AST) -> list[ast.AST]:
    """The node and all below it. `ast.walk` takes twice as long."""
    found = [top]
    for node in found:
        for value in vars(node).values():
            if isinstance(value, list):
                found += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST):
                found.append(value)
    return found


def _called(tree: ast.Module) -> set[str]:
    functions = (node.func for node in _nodes(tree) if isinstance(node, ast.Call))
    named = (each for each in functions if isinstance(each, ast.Attribute | ast.Name))
    return {each.attr if isinstance(each, ast.Attribute) else each.id for each in named}


def tracked() -> list[str]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    names = [name for name in listing.stdout.decode().split("\0") if name]
    if not names:  # an archive without its history
        names = [str(path.relative_to(ROOT)) for top in CODE for path in (ROOT / top).rglob("*.py")]
    return [name for name in names if (ROOT / name).is_file()]


class Class(NamedTuple):
    """A class of a file. members: names of its methods and fields."""

    name: str
    members: frozenset[str]
    is_protocol: bool


class Code(NamedTuple):
    """What the rules ask of a file. imports, classes: of Python alone."""

    violations: list[str]
    imports: set[str]
    classes: list[Class]


@cache
def _code(name: str) -> Code:
    """Read a file once for all rules. Its tree does not stay: those of all files would be half a gigabyte."""
    data = (ROOT / name).read_bytes()
    if b"\0" in data:
        return Code([], set(), [])
    text = data.decode(errors="replace")
    if not name.endswith(".py") or name.split("/")[0] not in CODE:
        return Code(violations(name, text), set(), [])
    tree = _tree(text)
    return Code(violations(name, text), {*_imports(PurePosixPath(name), tree)}, _classes(tree))


def test_every_file_keeps_the_rules() -> None:
    found = [each for name in tracked() for each in _code(name).violations]

    assert not found, "\n".join(found)


DEFINED_TWICE = (
    "Absent Aim Arrived Chain Clock Clocks Commands Course Ended Foresight Gesture Heard HeardWords Hearing "
    "Hold Holder Impossible Instant Link Listening Made Measured Member Named Off Options Order Parts Past "
    "Pause Performing Piece Place Played Problem Recording Row Run Session Shown Solution Spoken Stage "
    "Steering Stroke Stuck Table Term Told Track Unread Utterance Utterances Watch Word Written "
)
"""Names of classes that mean several things. Each of them costs its readers a look at the imports: take names off
this list, and put none on it. `Options` are those of each command."""


def test_a_class_name_means_one_thing() -> None:
    places = defaultdict[str, list[str]](list)
    for name in tracked():
        if name.startswith(("schemas/", "services/")) and name.endswith(".py"):
            for each in _code(name).classes:
                if not each.name.startswith("_"):
                    places[each.name].append(name)

    twice = {name: files for name, files in places.items() if len(files) > 1 and name not in DEFINED_TWICE.split()}
    assert len(places) > 500
    assert not twice, f"these names mean two things: {twice}"


def test_no_module_imports_itself_through_others() -> None:
    """Nor for types alone: what stands under TYPE_CHECKING counts as well."""
    modules = {}
    for path in tracked():
        place = PurePosixPath(path)
        if place.parts[0] in ("schemas", "services") and place.suffix == ".py":
            modules[".".join(place.with_suffix("").parts).removesuffix(".__init__")] = path
    imports = {name: _code(path).imports & modules.keys() - {name} for name, path in modules.items()}
    # A package is imported with each of its modules; what it says itself counts, that it is there does not.
    imports = {name: {each for each in found if not name.startswith(each + ".")} for name, found in imports.items()}
    while free := {name for name, found in imports.items() if not found & imports.keys()}:
        imports = {name: found for name, found in imports.items() if name not in free}
    circle = {name for name, found in imports.items() if any(name in others for others in imports.values())}

    assert not circle, f"these import one another, or what does: {', '.join(sorted(circle))}"


SEAMS = {
    "services/recording: Records": "a list fulfils it, too",
}
"""Protocols of which there is one class in their folder, and why they stand all the same."""


def slices(by_file: dict[str, list[Class]]) -> list[str]:
    """Protocols that describe one class of their own folder, by its path: a class that was cut in slices.

    A seam has several classes behind it, or one that stands elsewhere; then a Protocol is right. by_file: by path.
    """
    classes = [(PurePosixPath(path).parent, each) for path, classes in by_file.items() for each in classes]
    found = []
    for folder, (protocol, members, is_protocol) in classes:
        if members and is_protocol:
            described = [
                (place, each.name) for place, each in classes if not each.is_protocol and members <= each.members
            ]
            if [place for place, _ in described] == [folder]:
                found.append(f"{folder}: {protocol} describes {described[0][1]} and nothing else: name the class")
    return found


def _classes(tree: ast.Module) -> list[Class]:
    """The classes of a file; those within functions have no Protocol outside."""
    return [
        Class(each.name, _members(each), any("Protocol" in ast.unparse(base) for base in each.bases))
        for each in tree.body
        if isinstance(each, ast.ClassDef)
    ]


def _members(of: ast.ClassDef) -> frozenset[str]:
    """Names of its methods and fields, those that its methods set too."""
    named = {each.name for each in of.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)}
    named |= {ast.unparse(each.target) for each in of.body if isinstance(each, ast.AnnAssign)}
    for each in _below(of):
        if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store) and ast.unparse(each.value) == "self":
            named.add(each.attr)
    return frozenset(named - {"__init__"})


def test_no_protocol_describes_one_class_of_its_own_folder() -> None:
    code = [name for name in tracked() if name.split("/")[0] in CODE and name.endswith(".py")]
    found = slices({name: _code(name).classes for name in code})

    assert {each.split(" describes ")[0] for each in found} == SEAMS.keys(), "\n".join(found)


@pytest.mark.parametrize(
    ("others", "is_slice"),
    [
        ({"services/x/a.py": "class A:\n    def f(self): ...\n    def g(self): ..."}, True),
        ({"services/x/a.py": "class A:\n    def __init__(self): self.x = 1\n    def f(self): ..."}, True),
        ({"services/y/a.py": "class A:\n    def f(self): ..."}, False),
        ({"services/x/a.py": "class A:\n    def f(self): ...\nclass B:\n    def f(self): ..."}, False),
        ({"services/x/a.py": "class A:\n    def g(self): ..."}, False),
    ],
)
def test_a_slice_of_a_class_is_told_from_a_seam(others: dict[str, str], is_slice: bool) -> None:
    protocol = {"services/x/p.py": "class P(Protocol):\n    def f(self): ..."}
    by_file = {path: _classes(ast.parse(text)) for path, text in {**protocol, **others}.items()}

    assert bool(slices(by_file)) == is_slice


def test_the_list_of_shells_holds_only_files_that_need_it() -> None:
    for name in SHELLS:
        path = ROOT / name
        assert path.is_file(), f"{name} is gone: take it off the list"
        parts = [each.split(".") for each in _code(name).imports]
        needs = [each for each in parts if each[0] in IMPURE or each[1:2] in ([m] for m in MACHINERY)]
        assert needs, f"{name} is pure: take it off the list"


@pytest.mark.parametrize(
    ("path", "text", "reason"),
    [
        ("services/commandline/app.py", "from services.bus import Bus", "its name is engage_hri.services.bus"),
        ("tests/test_x.py", "import schemas.keys", "its name is engage_hri.schemas.keys"),
        ("schemas/x.py", "import asyncio", "pure"),
        ("schemas/x.py", "from engage_hri.services import bus", "knows no service"),
        ("services/realizer/plan/x.py", "from engage_hri.services.bus.interface import Bus", "pure"),
        ("services/control/service.py", "from engage_hri.services.simulation import table", "no business on a robot"),
        ("schemas/x.py", "from services import bus", "knows no service"),
        ("schemas/x.py", "def f():\n    from time import monotonic", "pure"),
        ("services/realizer/plan/x.py", "import random", "pure"),
        ("services/realizer/plan/x.py", '"""It begins."""', "noun or a verb"),
        ("schemas/x.py", 'def f():\n    """Noticeably?"""', "noun or a verb"),
        ("services/realizer/plan/x.py", "import logging.handlers", "pure"),
        ("services/realizer/plan/x.py", "from engage_hri.services.requests.ends import Requester", "pure"),
        ("services/realizer/plan/x.py", "from engage_hri.services.bus import zenoh", "pure"),
        ("services/realizer/plan/x.py", "from ...requests import Requester", "pure"),
        ("services/realizer/service.py", "from services.generation.config import X", "one another"),
        ("services/realizer/service.py", "from services import generation", "one another"),
        ("services/simulation/x.py", "from services.realizer.service import X", "one another"),
        ("services/realizer/plan/x.py", "from services.tangram.table import TangramTable", "no tangram"),
        ("services/console/web/x.py", "from services import tangram", "no tangram"),
        ("services/control/torso/x.py", "import services.tangram.table", "no tangram"),
        ("services/control/service.py", "from services.simulation import table", "no business on a robot"),
        ("services/control/service.py", "import zenoh", "imports zenoh"),
        ("services/commandline/app.py", "from zenoh import Config", "imports zenoh"),
        ("services/control/arm.py", "import zenoh", "imports zenoh"),
        ("services/realizer/plan/x.py", "from engage_hri.services.realizer.decide.facts import Facts", "not below"),
        (
            "services/realizer/decide/x.py",
            "from engage_hri.services.realizer.perform import performance",
            "not below",
        ),
        ("services/recognition/events/x.py", "import engage_hri.services.recognition.service", "not below"),
        ("services/generation/block/x.py", "from engage_hri.services.generation.head import arbiter", "not below"),
        ("services/bus/x.py", "from engage_hri.services.requests.ends import Requester", "not below"),
        ("services/control/x.py", "import math", "no place in the layers"),
        ("schemas/x.py", "from engage_hri.schemas.documents.xml_grammar import PARTS", "not below"),
        ("services/commandline/app.py", "import threading", "no threads"),
        ("services/console/web/visitor.py", "from starlette import routing", "for the window's server alone"),
        ("services/bus/zenoh/hub.py", "from concurrent.futures import ThreadPoolExecutor", "no threads"),
        ("services/commandline/app.py", "async def f():\n    await asyncio.to_thread(g)", "no threads"),
        ("services/commandline/app.py", "loop.run_in_executor(None, f)", "no threads"),
        ("services/commandline/app.py", "key = 'engage/v1/cmd/realizer/block'", "spells a key"),
        ("examples/x.py", "import zenoh", "imports zenoh"),
        ("examples/plain_zenoh_events.py", "from schemas import keys", "do without"),
        ("examples/x.py", "key = f'robot/engage/v1/{x}'", "spells a key"),
        ("services/commandline/app.py", "x = 1\n" * 601, "601 lines"),
        ("tests/test_x.py", "import time\ntime.sleep(1)", "sleeps"),
        ("tests/test_x.py", "from time import sleep", "time.sleep"),
        ("tests/test_x.py", "@pytest.mark.real_time\nasync def test_x():\n    await asyncio.sleep(1)", "sleeps"),
        (
            "tests/x/test_x.py",
            "pytestmark = pytest.mark.real_time\nasync def f():\n    await asyncio.sleep(t)",
            "sleeps",
        ),
        ("README.md", "see /home/someone/engage", "somebody's machine"),
        ("Makefile", "pip install --index-url x", "package index"),
        ("constraints.txt", "# from https://example.org/pypi/simple/", "package index"),
    ],
)
def test_a_broken_rule_is_caught(path: str, text: str, reason: str) -> None:
    assert any(reason in violation for violation in violations(path, text))


@pytest.mark.parametrize(
    ("path", "text"),
    [
        (
            "services/realizer/service.py",
            "import asyncio\nfrom engage_hri.services.bus import Bus\nfrom engage_hri.services.realizer import net",
        ),
        (
            "services/realizer/plan/x.py",
            "import numpy\nfrom engage_hri.services.realizer.config import RealizerConfig",
        ),
        ("services/tangram/people/x.py", "from engage_hri.services.tangram.table import TangramTable"),
        ("services/realizer/perform/performance.py", "import asyncio"),
        ("services/bus/zenoh/hub.py", "import time\nimport zenoh"),
        ("services/commandline/look/demo.py", "from engage_hri.services.simulation import service\nimport asyncio"),
        ("services/commandline/app.py", "from engage_hri.services.realizer.service import realize"),
        ("schemas/keys.py", "PREFIX = 'engage/v1'"),
        ("tests/test_x.py", "async def test_x():\n    await asyncio.sleep(5)  # virtual"),
        ("tests/test_x.py", "@pytest.mark.real_time\nasync def test_x():\n    await asyncio.sleep(0)"),
        ("tests/test_x.py", "import threading\nimport time\ntime.monotonic()"),
        ("README.md", "https://example.org/work/engage and ../home/x and /usr/bin/env"),
    ],
)
def test_what_the_rules_allow_is_left_alone(path: str, text: str) -> None:
    assert violations(path, text) == []
