"""A plugin of pytest, `-p tests.mutants.order`: the files run in the order in which they were named.

It ends the run if the code is not that of the tree in which it runs: a mutant that nobody runs would live.
"""

from pathlib import Path

import pytest

import engage_hri.schemas
import engage_hri.services


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """After conftest.py, which has the longest files first."""
    places = {str(config.rootpath / name): place for place, name in enumerate(config.args)}
    items.sort(key=lambda item: places.get(str(item.path), len(places)))


def pytest_configure(config: pytest.Config) -> None:
    for package in (engage_hri.services, engage_hri.schemas):
        file = Path(str(package.__file__)).resolve()  # a link may lead out of the tree
        if not file.is_relative_to(config.rootpath.resolve()):
            raise pytest.UsageError(f"{package.__name__} is {file}, which is not in {config.rootpath}")
