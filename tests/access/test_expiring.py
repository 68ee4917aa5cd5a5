"""Processes whose certificates end soon say so, the router among them."""

from pathlib import Path

import pytest

from engage_hri.services.bus.certificates import initialize
from tests.access.fortress import Told
from tests.bus.places import OWN_ADDRESS, free_endpoint

pytestmark = pytest.mark.real_time


def test_a_service_and_the_router_tell_that_their_certificates_end_soon(tmp_path: Path) -> None:
    ring, endpoint = tmp_path / "ring", free_endpoint().replace("tcp/", "tls/")
    initialize(ring, "robot", [], [OWN_ADDRESS], 2)
    programs = {}
    try:
        programs["router"] = Told("router", "--listen", endpoint, "--keys", ring)
        programs["router"].expect("router is ready")
        programs["control"] = Told("run", "control", "--connect", endpoint, "--keys", ring)
        programs["control"].expect("control is ready")
        for name, program in programs.items():
            program.expect(f"the certificate of robot/{name}/{name} expires in 2 days, and its links end then")
    finally:
        for program in programs.values():
            program.end()
