"""A robot of other people, the iCub, held to the contract of bodies through a description of its model."""

from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
pytest.importorskip("icub_models", reason="needs the package icub-models, which has the model")

from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.mujoco.described import DescribedBody
from engage_hri.services.control.testing import BodyContract
from tests.random_cases import trials

ICUB = Path(__file__).parent / "robots" / "icub.toml"


class TestDescribedBody(BodyContract):
    seeds = trials()
    tolerance = 0.1

    def make(self) -> Body:
        return DescribedBody(ICUB)
