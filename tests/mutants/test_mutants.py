"""What `make mutants` draws, and that it tells the truth of what a test has noticed."""

import shutil
from pathlib import Path
from typing import cast

import pytest

from tests.mutants.__main__ import ROOT, Copy, Mutant, diff, drawn, known
from tests.mutants.nearest import Nearest
from tests.mutants.operators import changes, compiles

CODE = "def f(a, b):\n    {}\n"


@pytest.mark.parametrize(
    ("line", "mutants"),
    [
        ("return a < b", {"return a <= b"}),
        ("return a not in b", {"return a in b"}),
        ("return a is not b", {"return a is b"}),
        ("return a and b and 7", {"return a or b and 7", "return a and b and 8"}),
        ("return a - b", {"return a + b"}),
        ("return (a) * (b + 1)", {"return (a) / (b + 1)", "return (a) * (b - 1)", "return (a) * (b + 2)"}),
        ("return a if b else True", {"return a if (not (b)) else True", "return a if b else False"}),
        ("return 2.0", {"return 2.6"}),
        ("return g(a, b, c=0.0)", {"return g(b, a, c=0.0)", "return g(a, b, c=0.5)"}),
        ("a.c = b", {"pass"}),
        ("a += b", {"pass"}),
        ("await_(a)", {"pass"}),
        ("while a: break", {"while (not (a)): break"}),
        ("return max(a, b)", set()),
        ("log.info(a, b)", set()),
        ("return f'{a + b}'", set()),
        ("return 'x' + a", set()),
        ("c: Annotated[int, 3] = a", set()),
        ("return cast(Sequence[b], a)", set()),
        ("raise ValueError('a', 'b')", {"raise ValueError('b', 'a')"}),
        ("return 'é' < a", {"return 'é' <= a"}),
    ],
)
def test_each_change_is_one_small_change_of_what_runs(line: str, mutants: set[str]) -> None:
    source = CODE.format(line).encode()

    assert {each.applied(source).decode() for each in changes(source)} == {CODE.format(line) for line in mutants}


def test_what_stands_outside_of_functions_is_known_as_such() -> None:
    source = b"LIMIT = 3\n\n\nclass It:\n    size: int = 4\n\n    def f(self):\n        return 5\n"

    assert [(each.line, each.alone) for each in changes(source)] == [(1, True), (5, True), (8, False)]


def test_the_same_seed_draws_the_same_mutants_one_of_a_line_and_more_of_them_begin_alike() -> None:
    many, again, few = (drawn(3, number, "services/text") for number in (20, 20, 5))

    assert many == again
    assert many[:5] == few
    assert many != drawn(4, 20, "services/text")
    assert len({(each.file, each.change.line) for each in many}) == 20
    assert {each.change.kind for each in many} >= {"compare", "negate", "swap", "remove"}


def test_a_mutant_is_told_with_its_line_and_what_has_become_of_it() -> None:
    mutant = next(each for each in drawn(3, 20, "services/text") if each.change.kind == "negate")
    lines = diff(mutant).splitlines()

    assert lines[0] == f"@@ -{mutant.change.line} +{mutant.change.line} @@"
    assert lines[1] == "-" + (ROOT / mutant.file).read_text().splitlines()[mutant.change.line - 1]
    assert lines[2].startswith("+")
    assert "(not (" in lines[2]


def test_each_mutant_that_may_live_is_one_of_the_code_and_has_a_reason() -> None:
    missing = []
    for (file, line, old, new), reason in known().items():
        source = (ROOT / file).read_bytes()
        lines = source.decode().splitlines()
        found = {
            (lines[each.line - 1].strip(), source[each.start : each.end].decode(), each.new)
            for each in changes(source)
        }
        if (line, old, new) not in found or len(reason) < 20:
            missing.append((file, line, old, new))

    assert missing == []


# -- a tree of one module, and a file of tests --------------------------------------------------------------------

MODULE = "def most(a, b):\n    while False:\n        pass\n    return a if a > b else b\n"
TESTS = """\
import engage_hri.services.most as it


def test_one():
    assert it.most(1, 2) == 2
"""
FAILS_ANYHOW = "import pytest\npytestmark = [pytest.mark.real_time]\ndef test_late(): assert False\n"


class Map:
    """Files of tests with the seconds that they take."""

    def __init__(self, *doubtful: str) -> None:
        self.seconds = {"tests/test_one.py": 0.1, "tests/test_late.py": 0.1}
        self.doubtful = set(doubtful)


@pytest.fixture
def tree(tmp_path: Path) -> Copy:
    for folder in ("engage_hri/services", "engage_hri/schemas", "tests/mutants"):
        (tmp_path / folder).mkdir(parents=True)
    for package in ("engage_hri", "engage_hri/services", "engage_hri/schemas", "tests", "tests/mutants"):
        (tmp_path / package / "__init__.py").touch()
    shutil.copy(ROOT / "tests/mutants/order.py", tmp_path / "tests/mutants")
    (tmp_path / "engage_hri/services/most.py").write_text(MODULE)
    (tmp_path / "tests/test_one.py").write_text(TESTS)
    (tmp_path / "tests/test_late.py").write_text(FAILS_ANYHOW)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = real_time\n")
    copy = Copy.__new__(Copy)  # without the files of this project
    copy.root, copy._written = tmp_path, 1_000_000_000
    return copy


def mutant(kind: str, new: str) -> Mutant:
    change = next(each for each in changes(MODULE.encode()) if (each.kind, each.new.strip()) == (kind, new))
    return Mutant("services/most", "engage_hri/services/most.py", change, "", "")


def judged(tree: Copy, what: Mutant, *tests: str, doubtful: tuple[str, ...] = ()) -> str:
    return tree.judged(what, [f"tests/test_{name}.py" for name in tests], cast(Nearest, Map(*doubtful)), 60.0).killer


def test_a_mutant_that_a_test_notices_is_killed_by_that_test_and_one_that_none_notices_lives(tree: Copy) -> None:
    negated, equal = mutant("negate", "(not (a > b))"), mutant("compare", ">=")

    # In turn: compiled code of the one must not serve for the other.
    verdicts = [judged(tree, each, "one") for each in (negated, equal, negated)]

    assert verdicts == ["tests/test_one.py::test_one", "", "tests/test_one.py::test_one"]
    assert (tree.root / "engage_hri/services/most.py").read_text() == MODULE


def test_a_test_that_fails_without_the_mutant_as_well_kills_none(tree: Copy) -> None:
    late = ("tests/test_late.py",)

    assert judged(tree, mutant("compare", ">="), "late", "one", doubtful=late) == ""
    assert (
        judged(tree, mutant("negate", "(not (a > b))"), "late", "one", doubtful=late) == "tests/test_one.py::test_one"
    )


def test_a_mutant_that_hangs_is_killed(tree: Copy, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.mutants.__main__.STARTS", 5.0)
    (tree.root / "engage_hri/services/most.py").write_text(MODULE.replace("while False", "while a == 0"))
    source = (tree.root / "engage_hri/services/most.py").read_bytes()
    change = next(each for each in changes(source) if each.kind == "compare" and each.line == 2)

    assert judged(tree, Mutant("services/most", "engage_hri/services/most.py", change, "", ""), "one") == "timeout"


@pytest.mark.parametrize("reader", ["conftest", "test_one"])
def test_a_mutant_that_cannot_be_imported_is_killed_and_told_apart(tree: Copy, reader: str) -> None:
    (tree.root / f"tests/{reader}.py").write_text(
        "import engage_hri.services.most as it\nassert it.most(1, 2) == 2\n"
    )
    verdict = tree.judged(mutant("negate", "(not (a > b))"), ["tests/test_one.py"], cast(Nearest, Map()), budget=60.0)

    assert reader in verdict.killer
    assert verdict.is_noticed_anyhow


def test_code_of_another_tree_is_not_judged(tree: Copy, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.rmtree(tree.root / "engage_hri")
    (tree.root / "engage_hri").symlink_to(ROOT / "engage_hri")

    with pytest.raises(SystemExit, match=r"which is not in"):
        tree._first_red(["tests/test_one.py"], 60.0)


def test_what_is_no_python_is_not_drawn() -> None:
    assert [compiles(code) for code in (b"f(a, b=1)", b"f(b=1, a)")] == [True, False]
