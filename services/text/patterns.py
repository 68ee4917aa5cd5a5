"""Patterns of marks: those of CommonMark, GitHub and HTML that the reader of `marks.py` looks for.

Each is to end with something that shows its end, so that a text which still comes may match in part.
"""

import unicodedata

from engage_hri.schemas.text import UNSPACED
from engage_hri.services.text.acts import IN_ASTERISKS, IN_BRACKETS, IN_PARENTHESES

THOUGHTS = frozenset({"think", "thinking", "thought", "thoughts", "reasoning", "reflection", "scratchpad"})
"""Elements in which models think, so that what is in them is not meant for the person."""
_BLOCKS = """
address article aside blockquote body br dd details div dl dt figure figcaption footer form h1 h2 h3 h4 h5 h6 head
header hr html li main nav ol p pre section summary table tbody td tfoot th thead tr ul speak break paragraph
sentence title
"""
BLOCKS = frozenset(_BLOCKS.split())
"""Elements that separate the words before and after them."""

_LETTER = r"[^\W_]"
_ATTRIBUTE = r"\s+[A-Za-z_:][\w:-]*(?:\s*=\s*(?:\"[^\"]*\"|'[^']*'|[^\s\"'=<>`]+))?"
TAG = rf"</?(?P<name>[A-Za-z][\w-]*(?::[A-Za-z_][\w-]*)?)(?:{_ATTRIBUTE})*\s*/?>"
"""With a prefix as XML has it: `<tel:112>` and `<https://x.org>` are addresses."""
_HIDES = rf"(?i)<(?:[\w-]+:)?(?P<hidden>script|style|template|svg|math|tool_call|function_call)(?:{_ATTRIBUTE})*\s*>"
HIDDEN = rf"{_HIDES}(?:[^<]++|<(?!/(?:[\w-]+:)?(?P=hidden)\s*>))*+</[^>]*>"
"""An element of which the content is not said. Without its end it is a tag, and the words behind it are said."""
TOKEN = r"<\|[\w-]{1,40}\|>"
"""Tokens that steer a model, and that it has let slip: `<|im_end|>`."""
COMMENT = r"<(?:!--[\s\S]*?--|!\[CDATA\[[\s\S]*?\]\]|\?[\s\S]*?\?|![A-Za-z][^>]*)>"
AUTOLINK = r"<(?P<address>[A-Za-z][A-Za-z0-9+.-]{1,31}:[^\s<>]*|[\w.+-]+@[\w-]+(?:\.[\w-]+)+)>"
_NO_ADDRESS, _STOPS = r"\s<>\[\]*`|{}\"", ".,;:!?'_~&"
ADDRESS = (
    rf"(?i)(?<![\w@.])(?P<address>(?:(?:https?|ftps?|file|mailto|tel):(?://)?(?=[\w+/])|(?=www\.\w))"
    rf"(?:[^{_NO_ADDRESS}()]|\([^{_NO_ADDRESS}()]*\))+(?<![{_STOPS}]))"
    rf"(?=[{_STOPS}]*(?:[{_NO_ADDRESS})]|\([^{_NO_ADDRESS}()]*+[{_NO_ADDRESS}(]))"
)
"""With brackets in it that are closed: `https://x.org/a_(b)`, but `(see https://x.org)`."""
HOST = r"(?i)(?:[a-z]+:/*)?(?:[^/@\s]*@)?(?:www\.)?(?P<host>[^/?#:\s]*)"
ENTITY = r"&(?:[A-Za-z][A-Za-z0-9]{1,31}|#[0-9]{1,7}|#[xX][0-9A-Fa-f]{1,6});"
_TITLE = r"(?:\"[^\"]*\"|'[^']*'|\([^()]*\))"
_LINK = rf"\(\s*(?:<[^<>\n]*>|(?!<)(?:[^\s()]|\([^\s()]*\))*)(?:\s+{_TITLE})?\s*\)"
LINK = rf"\]{_LINK}"
_CLOSED = r"\([^\s()]*\)"
ADDRESSED = rf"(?:\((?:[^\s()]|{_CLOSED})*\)|(?=[^(]|\((?:[^\s()]|{_CLOSED})*(?:\s|\([^\s()]*[\s(])))"
"""Behind a reference: the address of a link, or what shows that there is none."""
LABEL = r"\]\[[^\[\]\n]{0,80}\]"
_LABEL = r"\[(?P<label>[^\[\]\n^][^\[\]\n]{0,79})\]"
_DESTINATION = r"(?:<[^<>\n]*>|(?=[^\s<]*(?:[:/#]|\.\w))[^\s<]\S*)"
DEFINITION = rf"(?<=\n){_LABEL}:[ \t]*{_DESTINATION}(?:[ \t]+{_TITLE})?[ \t]*(?=\n)"
"""Of a link, with what looks like an address: `[Robot]: Hello.` is words."""
INDEX = rf"(?<=(?![{UNSPACED}])\w)"
"""Behind a name, where a bracket is an index: `array[0]`."""
_NO_INDEX = rf"(?!{INDEX})"
TASK = r"\[[xX ]\](?=\s)"
_FOOTNOTE = r"\[\^[^\s\[\]]+\]"
FOOTNOTE = rf"(?<=\n){_FOOTNOTE}:|{_FOOTNOTE}(?=[^:])|(?<!\n){_FOOTNOTE}"
_NUMBER = r"[1-9]\d{0,2}"
_NUMBERS = rf"\[{_NUMBER}(?:\s*[,;–-]\s*{_NUMBER})*\]"
CITATION = rf"{_NO_INDEX}(?P<told>{_NUMBERS})(?:{_LINK}|(?=[^(:\d]|:\s)|(?=\([^)\n]*\)))"
IMAGE = rf"(?<!{_LETTER})!(?=\[)"
SOURCE = r"【\d+(?::\d+)?†[^】\n]{0,80}】"
IN_SQUARE = rf"(?i){_NO_INDEX}\[{IN_BRACKETS}\](?=[^(])"
IN_ROUND = rf"(?i)(?<!{_LETTER})\({IN_PARENTHESES}\)"
IN_STARS = (
    rf"(?i)(?<!{_LETTER})(?P<mark>[*_]){IN_ASTERISKS}(?P=mark)(?=[.,!…]|\s+(?:(?P<small>(?-i:\p{{Ll}}))|\S)|\s*\n)"
)
"""Before a small letter it is one only with a verb in the third person: `*Looking* at it` is an emphasis."""
_UNSAID = rf"{CITATION}|{FOOTNOTE}|{SOURCE}|{IN_SQUARE}|{IN_ROUND}"
BEFORE_UNSAID = rf"(?<=\w)[ ]+(?=(?:[ ]*(?:{_UNSAID}))+[.,;:!?…])"
"""A blank that would be left between a word and its full stop."""
SIGN = (
    rf"(?<=\s)\*{{1,2}}(?=\s)|(?<={_LETTER})_+(?={_LETTER})|(?<=\))\*{{1,2}}(?=\()|(?<=\d)\*{{1,2}}(?={_LETTER})"
    rf"|(?<={_LETTER})\*{{1,2}}(?=\d)|(?<=[\W_]{_LETTER})\*{{1,2}}(?={_LETTER})"
)
"""Asterisks and underscores that are signs: between operands, and within names."""
CODE = r"(?P<run>`+)(?!`)(?P<code>(?:[^`\n]+|\n(?![ \t]*\n)|(?!(?P=run)(?!`))`+)*+)(?P=run)(?=[^`])"
ROWS = r"\|(?:[ \t]*+:?-++:?[ \t]*+\|)++(?=[ \t]*+:?+(?:[^-]|-++:?+[ \t]*+[^|]))"
"""A line between rows within a line, for XML makes one line of a table. No cell follows."""
FENCE = r"(?P<fence>`{3,}(?=[^`\n]*\n)|~{3,})[^\n]*\n"
RULE = r"[-_*=:|][-_*=:| \t]*(?=\n)"
"""A line without words: under a heading, between paragraphs, or between rows of a table."""
HEADING = r"#{1,6}(?=[ \t\n])"
HEADING_ENDS = r"(?<=[ \t])#+[ \t]*(?=\n)"
BULLET = r"[-+*](?=\s)"
NUMBER = r"(?P<number>\d{1,9})[.)](?=\s)"
PLAIN = r"[^\W_ℹ\ufe0f\u20e3]+|[,;:'.?\"/%$+)}={-]+"
PUNCTUATION = r"[!-/:-@\[-`{-~【]"
"""Characters with which a mark may begin, and that a backslash makes words."""

_SILENT = frozenset(("So", "Sk", "Cf", "Cs", "Co", "Cn", "Cc"))
"""Categories of characters that are not given to an engine: emoji, which it would read out by name, and controls."""
_SAID = frozenset("♭♮°℃℉\u200c\u200d№℠™®©")
"""Of these, and said: flats, units, and joiners that belong to the spelling of Persian and of Indian scripts."""
_SILENT_TOO = frozenset("ℹ\ufe0f\u20e3")
"""What makes an emoji of the character before it, and a letter that is mostly one."""


def is_silent(character: str) -> bool:
    """Tell whether a character is an emoji, or has no sound for another reason."""
    if character.isascii():
        return not character.isprintable()
    if character in _SILENT_TOO:
        return True
    return character not in _SAID and unicodedata.category(character) in _SILENT
