"""Certificates of a window: what `--https` takes, what it makes, and what it refuses."""

import ssl
from pathlib import Path

import pytest

pytest.importorskip("cryptography", reason="needs the extra `keys`")

from cryptography import x509

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.certificates import initialize
from engage_hri.services.web.https import ServerKeys, server_keys

HOSTS = ("robot.example", "192.0.2.7")


def test_a_file_that_is_not_there_is_made_for_its_owner_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "window.pem"
    made = server_keys(path, HOSTS)
    content = path.read_bytes()
    names = x509.load_pem_x509_certificate(content).extensions.get_extension_for_class(x509.SubjectAlternativeName)

    assert made == ServerKeys(path, path) == server_keys(path, ("another",))
    assert path.read_bytes() == content
    assert path.stat().st_mode & 0o777 == 0o600
    assert set(names.value.get_values_for_type(x509.DNSName)) == {"localhost", "robot.example"}
    assert {str(each) for each in names.value.get_values_for_type(x509.IPAddress)} == {
        "127.0.0.1",
        "::1",
        "192.0.2.7",
    }


def test_the_folder_of_a_routers_keys_will_do(tmp_path: Path) -> None:
    initialize(tmp_path / "keys", "robot", (), HOSTS, 365)
    found = server_keys(tmp_path / "keys" / "router", ())

    context = ssl.create_default_context(cafile=tmp_path / "keys" / "ca.pem")
    assert context.cert_store_stats()["x509_ca"] == 1
    assert [each.name for each in found] == ["certificate.pem", "private.pem"]


@pytest.mark.parametrize("content", ["", "nonsense", "certificate alone", "another key"])
def test_what_is_no_certificate_with_its_key_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "window.pem"
    server_keys(path, HOSTS)
    certificate, dashes, _ = path.read_text().partition("-----BEGIN PRIVATE KEY-----")
    if content == "certificate alone":
        path.write_text(certificate)
    elif content == "another key":
        server_keys(tmp_path / "other.pem", HOSTS)
        path.write_text(certificate + dashes + (tmp_path / "other.pem").read_text().partition(dashes)[2])
    else:
        path.write_text(content)

    with pytest.raises(InputRefused, match="no certificate with its key"):
        server_keys(path, HOSTS)


def test_a_key_that_others_may_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "window.pem"
    server_keys(path, HOSTS)
    path.chmod(0o644)

    with pytest.raises(InputRefused, match=f"others may read the private key.*chmod 600 {path}"):
        server_keys(path, HOSTS)


def test_a_folder_without_keys_and_a_place_where_none_can_be_made_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "no" / "window.pem"):
        with pytest.raises(InputRefused, match="no certificate with its key: No such file"):
            server_keys(path, HOSTS)


def test_a_name_that_is_no_host_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputRefused, match="'a b' is no host"):
        server_keys(tmp_path / "window.pem", ("a b",))
