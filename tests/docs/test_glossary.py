"""The glossary speaks of what is in the code: each name in backticks is there, and each term stands once."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
NAMES = sorted(set(re.findall(r"`([^`\n]+)`", TEXT)))
TERMS = re.findall(r"^### (.+)$", TEXT, re.MULTILINE)
EXAMPLES = {"speech-1:end+0.5", "engage/v1/evt/control/sync_point"}
"""Not names: a sync reference and a key. The tests of these read them elsewhere."""


def _members(node: ast.ClassDef) -> Iterator[str]:
    """Fields, methods and attributes of a class."""
    for each in ast.walk(node):
        if isinstance(each, ast.AnnAssign):
            yield ast.unparse(each.target).removeprefix("self.")
        elif isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef):
            yield each.name


class Code:
    """What the tree defines. members: by class, its bases' too. words: strings, the values of literal types."""

    def __init__(self) -> None:
        self.classes: dict[str, set[str]] = {}
        self.names: set[str] = set()
        self.words: set[str] = set()
        bases: dict[str, list[str]] = {}
        for path in (*ROOT.glob("schemas/**/*.py"), *ROOT.glob("services/**/*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                match node:
                    case ast.ClassDef():
                        self.classes.setdefault(node.name, set()).update(_members(node))
                        bases.setdefault(node.name, []).extend(ast.unparse(base) for base in node.bases)
                    case ast.FunctionDef() | ast.AsyncFunctionDef():
                        self.names.add(node.name)
                    case ast.Assign() | ast.AnnAssign():
                        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                        self.names |= {target.id for target in targets if isinstance(target, ast.Name)}
                    case ast.Constant(value=str() as text):
                        self.words.add(text)
        for name, above in bases.items():
            for base in above:
                self.classes[name] |= self.classes.get(base, set())

    def has(self, name: str) -> bool:
        if "/" in name:
            return (ROOT / name).exists()
        owner, _, member = name.rpartition(".")
        if name in self.classes or name in self.names or name in self.words:
            return True
        return member in self.classes.get(owner, ())


@pytest.fixture(scope="module")
def code() -> Code:
    return Code()


@pytest.mark.parametrize("name", [name for name in NAMES if name not in EXAMPLES])
def test_a_name_in_the_glossary_is_in_the_code(name: str, code: Code) -> None:
    assert code.has(name)


@pytest.mark.parametrize("name", ["NoSuchThing", "Robot.nothing", "Nothing.perform", "services/nothing"])
def test_a_name_that_is_not_there_is_missed(name: str, code: Code) -> None:
    assert not code.has(name)


def test_each_term_stands_once_and_in_the_order_of_the_alphabet() -> None:
    assert len(TERMS) == len(set(TERMS)) > 40
    for part in TEXT.split("\n## ")[1:]:
        terms = re.findall(r"^### (.+)$", part, re.MULTILINE)
        assert terms == sorted(terms, key=str.casefold)


def test_examples_are_still_shown() -> None:
    assert set(NAMES) >= EXAMPLES
