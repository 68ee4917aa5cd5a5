"""The example of docs/hostile.md runs as it stands there."""

import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from engage_hri.services.control.torso.body import SimulatedBody

PAGE = Path(__file__).resolve().parents[2] / "docs" / "hostile.md"


def test_the_example_of_the_page_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    body = ModuleType("my_robot.body")
    body.MyBody = SimulatedBody  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "my_robot", ModuleType("my_robot"))
    monkeypatch.setitem(sys.modules, "my_robot.body", body)
    names: dict[str, Any] = {}

    exec(code, names)

    names["test_nothing_that_others_send_breaks_my_body_or_my_client"](3)
