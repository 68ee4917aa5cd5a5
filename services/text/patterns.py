"""Patterns of marks: those of CommonMark and HTML that the reader of `marks.py` looks for."""

import re
import unicodedata

LOOK = 1000
"""Characters that a mark may have from its start to its end: a text is not held back for longer."""
BRACKET = 80
"""Characters of what stands in brackets, if it is more than the words of a link."""
THOUGHTS = frozenset({"think", "thinking", "thought", "thoughts", "reasoning", "reflection", "scratchpad"})
"""Elements in which models think, so that what is in them is not meant for the person."""
UNSAID = THOUGHTS | {"script", "style", "template", "svg", "math"}
BLOCKS = frozenset(
    [
        "address",
        "article",
        "aside",
        "blockquote",
        "body",
        "br",
        "dd",
        "details",
        "div",
        "dl",
        "dt",
        "figure",
        "figcaption",
        "footer",
        "form",
        "h1",
        "h2",
        "h3",
        "h4",
        "h5",
        "h6",
        "head",
        "header",
        "hr",
        "html",
        "li",
        "main",
        "nav",
        "ol",
        "p",
        "pre",
        "section",
        "summary",
        "table",
        "tbody",
        "td",
        "tfoot",
        "th",
        "thead",
        "tr",
        "ul",
        "s",
        "speak",
        "break",
        "paragraph",
        "sentence",
        "title",
    ]
) - {"s"}
"""Elements that separate the words before and after them."""

_ATTRIBUTE = r"\s+[A-Za-z_:][\w.:-]*(?:\s*=\s*(?:\"[^\"]*\"|'[^']*'|[^\s\"'=<>`]+))?"
TAG = re.compile(rf"<(?:(?P<name>[A-Za-z][\w:-]*)(?:{_ATTRIBUTE})*\s*/?|/(?P<closed>[A-Za-z][\w:-]*)\s*)>")
_VALUE_BEGUN = r"(?:\s*=\s*(?:\"[^\"]*|'[^']*|[^\s\"'=<>`]*)?)?"
TAG_BEGUN = re.compile(
    rf"<(?:/?(?:[A-Za-z][\w:-]*)?|[A-Za-z][\w:-]*(?:{_ATTRIBUTE})*(?:\s*/?|\s+[A-Za-z_:][\w.:-]*{_VALUE_BEGUN}|/\s*)"
    r"|/[A-Za-z][\w:-]*\s*)\Z"
)
SENTENCE_IN_TAG = re.compile(r"[^\"']*[.!?]\s")
AUTOLINK = re.compile(r"<(?P<address>[A-Za-z][A-Za-z0-9+.-]{1,31}:[^\s<>]*|[\w.+-]+@[\w-]+(?:\.[\w-]+)+)>")
AUTOLINK_BEGUN = re.compile(r"<[A-Za-z][A-Za-z0-9+.-]*(?::[^\s<>]*|@?[\w.-]*)\Z")
ADDRESS = re.compile(r"(?:(?:https?|ftps?|file|mailto|tel):(?://)?|(?=www\.))[^\s<>\[\]*`|{}\"]+", re.IGNORECASE)
SCHEMES = ("https:/", "http:/", "ftps:/", "ftp:/", "file:/", "mailto:", "tel:", "www.")
"""Beginnings of an address. One letter may follow before it is known where it ends."""
HOST = re.compile(r"(?:[a-z]+:/*)?(?:[^/@\s]*@)?(?:www\.)?(?P<host>[^/?#:\s]*)", re.IGNORECASE)
ENTITY = re.compile(r"&(?:[A-Za-z][A-Za-z0-9]{1,31}|#[0-9]{1,7}|#[xX][0-9A-Fa-f]{1,6});")
ENTITY_BEGUN = re.compile(r"&(?:[A-Za-z][A-Za-z0-9]{0,31}|#[0-9]{0,7}|#[xX][0-9A-Fa-f]{0,6})?\Z")
_TITLE = r"\"[^\"]*\"|'[^']*'|\([^()]*\)"
_DESTINATION = r"<[^<>\n]*>|(?!<)(?:[^\s()]|\([^\s()]*\))*"
LINK = re.compile(rf"\(\s*(?P<to>{_DESTINATION})(?:\s+(?:{_TITLE}))?\s*\)")
LINK_BEGUN = re.compile(
    r"\(\s*(?:<[^<>\n]*|(?:<[^<>\n]*>|(?!<)(?:[^\s()]|\([^\s()]*\))*)(?:\([^\s()]*|\s*|\s+(?:\"[^\"]*|'[^']*|\([^()]*)"
    r"|\s+(?:\"[^\"]*\"|'[^']*'|\([^()]*\))\s*))\Z"
)
DEFINITION = re.compile(rf":[ \t]*(?:<[^<>\n]*>|[^\s<]\S*)(?:[ \t]+(?:{_TITLE}))?[ \t]*(?=\n|\Z)")
INSIDE = re.compile(r"\[(?P<inside>[^\[\]\n]{0,80})\]")
CITATION = re.compile(r"\d{1,4}(?:\s*[,;–-]\s*\d{1,4})*\Z")
FOOTNOTE = re.compile(r"\^[^\s\[\]]+\Z")
SOURCE = re.compile(r"【\d+(?::\d+)?†[^】\n]{0,80}】")
SOURCE_BEGUN = re.compile(r"【(?:\d+(?::\d*)?(?:†[^】\n]{0,80})?)?\Z")
FENCE = re.compile(r"(?P<fence>`{3,}(?=[^`\n]*(?:\n|\Z))|~{3,})[^\n]*")
RULE = re.compile(
    r"(?:[ \t]*(?:(?:-[ \t]*)+|(?:_[ \t]*){3,}|(?:\*[ \t]*){3,}|=+[ \t]*)|[-:| \t]*\|[-:| \t]*)(?=\n|\Z)"
)
"""A line without words: under a heading, between paragraphs, or between rows of a table."""
ITEM = re.compile(r"(?:[-+*](?=\s)|(?P<number>\d{1,9})[.)](?=\s))")
HEADING = re.compile(r"#{1,6}(?=[ \t\n]|\Z)")
HEADING_ENDS = re.compile(r"[ \t]+#+[ \t]*(?=\n|\Z)")
PLAIN = re.compile(r"[^\W_ℹ]+(?<![hwfmtHWFMT])|[^\W_ℹ]|[,;:'.?\"/%$+)}={-]+")
PUNCTUATION = frozenset("!\"#$%&'()*+,-./:;<=>?@[\\]^_`{|}~")

_SILENT = frozenset(("So", "Sk", "Cf", "Cs", "Co", "Cn", "Cc"))
"""Categories of characters that are not given to an engine: emoji, which it would read out by name, and controls."""
_SAID = frozenset("°℃℉\u200c\u200d№℠™®©")
"""Of these categories, and said: units, and joiners that belong to the spelling of Persian and of Indian scripts."""
_SILENT_TOO = frozenset("ℹ\ufe0f\u20e3")
"""What makes an emoji of the character before it, and a letter that is mostly one."""


def is_silent(character: str) -> bool:
    """Tell whether a character is an emoji, or has no sound for another reason."""
    if character.isascii():
        return not character.isprintable()
    if character in _SILENT_TOO:
        return True
    return character not in _SAID and unicodedata.category(character) in _SILENT
