"""The page on keys says what the tests try, no more and no less."""

import ast
import re
from pathlib import Path

from engage_hri.schemas import access
from engage_hri.services.bus.certificates import STANDARD

PAGE = (Path(__file__).parents[2] / "docs" / "security.md").read_text(encoding="utf-8")


def rows(heading: str) -> list[str]:
    section = PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return [cell.strip() for cell in re.findall(r"^\| (.*?) \|", section, re.MULTILINE)][1:]


def test_each_attack_is_a_row_and_each_row_an_attack() -> None:
    tree = ast.parse(Path(__file__).with_name("test_attacks.py").read_text(encoding="utf-8"))
    tests = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]
    told = [(ast.get_docstring(test) or "").splitlines()[0] for test in tests]
    honest = [line for line in told if line.startswith("Beside all these attacks")]
    assert len(honest) == 1
    assert sorted(rows("Attacks")) == sorted(set(told) - set(honest))


def test_each_standard_holder_has_its_role() -> None:
    lines = re.findall(r"^\| (`.*?) \| (.*?) \|", PAGE.partition("## Use them")[0], re.MULTILINE)
    for names, role in lines:
        for name in re.findall(r"`([\w-]+)`", names):
            expected = name if role == "the same" else role
            assert STANDARD.get(name, expected) == expected, name
    assert set(STANDARD) <= {name for names, _ in lines for name in re.findall(r"`([\w-]+)`", names)}
    assert {role for _, role in lines} - {"the same", access.ROUTER} <= set(access.ROLES)
