"""XML from strangers: bombs, noise, wrong encodings and half-broken blocks are refused, at once and by name."""

import time
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.blocks import Unread
from engage_hri.schemas.documents import xml_decode
from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.documents.xml_decode import MOST, decode_xml
from engage_hri.schemas.faults import InputRefused
from tests.random_cases import share_of
from tests.schemas.test_xml_codec import BML_1_0, DRAFT, FRAGMENT, block, refused

LAUGHS = (
    '<!DOCTYPE bml [<!ENTITY a0 "ha">'
    + "".join(f'<!ENTITY a{level} "{f"&a{level - 1};" * 10}">' for level in range(1, 10))
    + ']><bml id="&a9;"/>'
)
LONG = b"""<bml id="b-1" xmlns="org.mindmakers.bml" composition="merge" characterId="m">
  <gaze id="g-1" target="t" start="s:m1+0.5" end="b-1:p:stroke:2 - 1"/><wait id="w" duration="1.5"/>
  <gesture id="p" type="POINT" target="t" strokeStart="2" mode="LEFT_HAND"/><head id="h" type="NOD" amount="0.5"/>
  <face id="f" type="FACS" au="12" side="LEFT"/><posture id="o"><stance type="SITTING"/></posture>
  <speech id="s"><text>Oh <sync id="m1"/>well <tm id="m-2"/><b>then</b></text></speech>
  <required><constraint id="c"><synchronize ref="g-1:stroke"><sync ref="s:m1"/></synchronize>
  <before ref="3"><sync ref="w:end+1"/></before></constraint></required>
</bml>"""


@pytest.mark.parametrize(
    "wrong",
    ["<x></y>", '<a b="1" b="2"/>', "&foo;", '<x xmlns:k="u" xmlns:l="u" k:a="1" l:a="2"/>', "<a b=1/>", "<p:y/>"],
)
def test_what_is_no_xml_is_refused_with_its_line(wrong: str) -> None:
    fault = refused('<bml id="b">' + '<gaze id="g" target="t"\n x="1"/>' * 150 + f"{wrong}</bml>")

    assert fault.reason.startswith("malformed XML")
    assert fault.line == 151


@pytest.mark.parametrize(
    ("declared", "encoding"),
    [("", "utf-8"), ("", "utf-8-sig"), ("", "utf-16"), ("UTF-16", "utf-16"), ("utf-8", "utf-8")],
)
def test_a_document_may_be_in_unicode(declared: str, encoding: str) -> None:
    declaration = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    text = f'{declaration}\n<bml id="b"><speech id="s">café</speech></bml>'

    (decoded,) = read(text.encode(encoding))

    assert decoded.behaviors == (Speech(id="s", text="café", line=2),)


@pytest.mark.parametrize(
    ("declared", "encoding"),
    [("UTF-7", "utf-7"), ("klingon", "utf-8"), ("UTF-8", "latin-1"), ("UTF-16", "utf-8"),
     ("us-ascii", "latin-1"), ("ISO-8859-1", "latin-1"), ("IBM037", "cp037"), ("ISO-2022-JP", "ascii")],
)  # fmt: skip
def test_a_document_in_another_encoding_than_it_says_is_refused(declared: str, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{declared}"?>\n<bml id="b"><speech id="s">café</speech></bml>'

    assert refused(text.encode(encoding, errors="ignore")).reason.startswith("malformed XML")


@pytest.mark.parametrize(
    "hostile",
    [
        pytest.param(b'<!DOCTYPE bml [<!ENTITY a "b">]><bml id="&a;"/>', id="entity"),
        pytest.param(b'<!DOCTYPE bml SYSTEM "http://127.0.0.1:9/x.dtd"><bml id="b"/>', id="external DTD"),
        pytest.param('<!DOCTYPE bml><bml id="b"/>'.encode("utf-16"), id="document type in UTF-16"),
        pytest.param(b"<?a?><!-- b -->\n<!DOCTYPE bml><bml/>", id="document type after a comment"),
        pytest.param(b'<bml id="b">' + b"x" * 10_000_000 + b"</bml>", id="10 MB"),
        pytest.param(b'<bml id="b">' + b"<a>" * 100 + b"</a>" * 100 + b"</bml>", id="deep"),
        pytest.param(b"<bml>" + b"<a>" * 100_000, id="very deep"),
        pytest.param(b" " * 1_000_000 + b"<bml", id="much white space"),
        pytest.param(b"\xff\xfe\xfd", id="noise"),
        pytest.param(b'<bml id="b" ' + b" ".join(b'a%d="1"' % n for n in range(300_000)) + b"/>", id="attributes"),
        pytest.param(b'<bml id="b" ' + b" ".join(b'p:a%d="1"' % n for n in range(250_000)) + b"/>", id="prefixed"),
        pytest.param(b'<bml id="b" ' + b" ".join(b'p%d:a="1"' % n for n in range(200_000)) + b"/>", id="prefixes"),
        pytest.param(b'<bml id="b">' + b"<a/>" * 1_000_000 + b"</bml>", id="elements"),
        pytest.param(LAUGHS.encode("utf-16"), id="entity bomb in UTF-16"),
        pytest.param(LAUGHS.encode("utf-16-le"), id="entity bomb in UTF-16 without mark"),
        pytest.param(LAUGHS.encode("utf-32"), id="entity bomb in UTF-32"),
        pytest.param(LAUGHS.encode("cp037"), id="entity bomb in EBCDIC"),
        pytest.param(f'<?xml version="1.0" encoding="UTF-7"?>{LAUGHS}'.encode("utf-7"), id="entity bomb in UTF-7"),
        pytest.param("<bml id='b'><speech id='s'>\ud800</speech></bml>", id="half a character"),
        pytest.param(b'<bml id="b"><gaze id="g" target="t" start="g:' + b" x" * 400 + b'"/></bml>', id="spaces"),
    ],
)
def test_hostile_input_is_refused_at_once(hostile: bytes | str) -> None:
    began = time.process_time()

    fault = refused(hostile)

    assert fault.reason
    assert time.process_time() - began < 2.0


@settings(max_examples=share_of(300), deadline=None)
@given(
    st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode(errors="surrogatepass")),
    st.booleans(),
)
def test_noise_is_refused_and_nothing_else(noise: bytes, in_block: bool) -> None:
    with suppress(InputRefused):
        read(b'<bml id="b">' + noise + b"</bml>" if in_block else noise)
    with suppress(InputRefused):
        read(b'{"id": "b", "behaviors": [' + noise + b"]}")


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    """A block as somebody might write it, with some of it replaced, cut or doubled."""
    text = draw(st.sampled_from([FRAGMENT.encode(), LONG, LONG.replace(DRAFT.encode(), BML_1_0.encode())]))
    for _ in range(draw(st.integers(1, 4))):
        at, length = draw(st.integers(0, len(text))), draw(st.integers(0, 30))
        new = draw(st.sampled_from([b"", b"<", b">", b'"', b":", b"&", b"\0", b"id", b"-1", b"nan", b"9" * 400]))
        text = text[:at] + draw(st.sampled_from([new, text[at : at + length] * 2])) + text[at + length :]
    return text


@settings(max_examples=share_of(300), deadline=None)
@given(mutated())
def test_no_other_exception_ever_leaves_the_decoder(data: bytes) -> None:
    with suppress(InputRefused):
        decode_xml(data)


def test_of_many_unknown_attributes_some_are_told_and_the_rest_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """To find what was meant takes time for each: 200 kB held the realizer for a second and more."""
    searched = list[str]()
    monkeypatch.setattr(xml_decode, "meant", lambda name, known: searched.append(name) or "")
    attributes = " ".join(f'a{number}=""' for number in range(90))
    unread = block("".join(f'<gaze id="g{number}" target="t" {attributes}/>' for number in range(50))).unread

    assert len(searched) == len(unread) - 1 == MOST
    assert unread[-1] == Unread(message=f"{50 * 90 - MOST} more parts are ignored")


def test_one_part_more_is_one_part() -> None:
    attributes = " ".join(f'a{number}=""' for number in range(MOST // 2))
    half = f'<gaze id="%s" target="t" {attributes}/>'
    exactly, more = block(half % "g" + half % "h").unread, block(half % "g" + half % "h" + "<wink/>" * 2).unread
    too_many = block(half % "g" + half % "h" + '<gaze id="i" target="t" x=""/>').unread

    assert len(exactly) == MOST
    assert [each.kind for each in more[MOST:]] == ["BEHAVIOR_TYPE_NOT_SUPPORTED"] * 2
    assert too_many[MOST:] == (Unread(message="1 more part is ignored"),)
