"""Ends of sentences and clauses in a text of which the rest may still come.

A full stop ends a sentence, unless the word before it is an abbreviation, an initial or an ordinal. Some of these are
decided only by the word after it (`etc. and`, `etc. Then`): then the answer waits for one character of that word, and
for all others it is known as soon as there is white space. So nothing waits that needs not to.

The rule knows no language: the writer of a stream names none. tests/text/sentences.txt is what it is judged by, and
docs/decisions/0080 says why it is no library.
"""

import re
from collections.abc import Iterable
from typing import Literal, NamedTuple

from engage_hri.schemas.text import UNSPACED

_WORDS_BEFORE_A_WORD = """
EE Mr Mrs Ms Mx Dr Drs Prof St Ste Gov Sen Rep Gen Col Lt Maj Capt Cmdr Sgt Cpl Pvt Adm Rev Hon Pres Messrs Mme
Mlle Mgr MM Fr Sr Sra Srta Sres Dra Dña Dn Ud Uds Vd Sig sig sig.ra Sig.ra sigg dott Dott dott.ssa avv Avv ing
Ing arch Arq Eng Exmo Exma Dhr dhr Mevr mevr Mw mw drs ir mr Hr Frl Dipl Hrn Bc MUDr JUDr PhDr RNDr prof dr rer
jur inż mgr lek Sn sn Av Doç Yrd Dl dl Dna dna D-na D-l dlui ddl dra Bp Tn Ny Sdr г-н г-жа гр проф акад доц ул
пр пер д кв обл просп им тов св пан вул κ Κ κα Δρ д-р vs cf viz approx ca cca circa e.g i.e eg z.B d.h u.a o.ä
i.d.R z.T u.U m.E s.o s.u v.a p.ex p.ej ej bzw ggf evtl inkl exkl zzgl abzgl vgl sog bes insb allg jew d.i lt
bspw resp entspr bijv bv o.a m.a.w d.w.z i.p.v t.o.v t.ex bl.a d.v.s s.k f.eks esim ns mm mt np tzn tj m.in wg
ul pl św nr tzv popř např apod mj zvl vč napr pld kb ún de.ex mis dll yg örn bkz vb.g yakl напр см ср т.е
т.н т.к т.наз π.χ πχ δηλ βλ د أ م ص डॉ श्री श्रीमती पं Fa fa Abt Abb abb Str Hauptstr str av avda Avda blvd Blvd
Bd bd bld boul Pl ctra urb env
"""
BEFORE_A_WORD = frozenset(_WORDS_BEFORE_A_WORD.split())
"""A word always follows: the stop ends no sentence."""

_WORDS_BEFORE_A_NUMBER = """
No no Nos nos Nr nr Núm núm nº n° Nro nro Fig fig Figs figs Sec sec Sect sect Vol vol Ch ch Chap chap Art art
Par Abs abs Kap kap Bd bd Abb abb Tab tab pp ff pag pagg pág págs cap ed op Op Eq eq Eqs Ref Rd Bl bl рис табл
стр гл том ст č čís str tzv hl tel Tel Ext ext approx § сс № числ lk lpp oldal sid
"""
BEFORE_A_NUMBER = frozenset(_WORDS_BEFORE_A_NUMBER.split())
"""A number follows; without one the sentence is over: `No. 5`, but `No. I will not`."""

_WORDS_BEFORE_EITHER = """
ex
etc usw usf et al ecc enz itd itp atd apod m.m osv osb dst dsb vb vs.b u.s.w u.v.m u.ä о.б т.д т.п др пр руб коп
млн млрд тыс г гг в вв ч мин сек кг км см мм a.m p.m am pm Inc inc Corp corp Ltd ltd Co co Bros LLC Jr jr Sr Esq
Ph.D M.D B.A M.A D.C U.S U.K U.S.A U.N E.U EE.UU EEUU tbsp tsp oz lb lbs ft yd hr hrs dept Dept est Est assn
Assn misc Mwst MwSt St.d Std Min Sek Mio Mrd Tsd Stk Pkt Uhr geb gest Mo Di Mi Do Sa So ul zł gr godz min r w kr
kl kg stk år tim ds jl bc BC AD vChr nChr v.Chr n.Chr Ges e.V GmbH Tr sc approx ok str Fam Hbf Apr Aug Dec Dez
Feb Fri Jan Jän Mon Mär Nov Oct Okt Sat Sep Sept Thu Tue Wed max
"""
BEFORE_EITHER = frozenset(_WORDS_BEFORE_EITHER.split())
"""The sentence goes on if the next word begins with a small letter or a digit: `etc. and`, but `etc. Then`."""

_WORDS_ORDINAL_AFTER = """
der die das dem den des am im vom zum zur beim ab bis seit jeder jede jedes jedem jeden ihr ihre ihrem ihren
sein seine seinem seinen mein meine meinem meinen unser unsere unserem unseren dein deine euer eure kein keine
ein eine einem einen nach vor ins ans übers fürs dieser diese dieses diesem diesen und platz
"""
ORDINAL_AFTER = frozenset(_WORDS_ORDINAL_AFTER.split())
"""Words after which a number with a full stop is an ordinal, though a capital letter follows: `die 1. Bundesliga`."""


CLOSING = "\"'”’“‘»)\\]"
_CLOSING_WIDE = f"{CLOSING}」』）】》〉］｝〕"
_STOPS_WIDE = "。！？｡။។"
_STOPS = ".!?…।؟۔։።፧"
_WIDE = f"(?<=[{UNSPACED}])"
"""Behind a character of a script without spaces a stop needs no space after it, either."""
_SENTENCE = rf"(?P<stops>[{_STOPS}]+|(?<=[\u0370-\u03ff\u1f00-\u1fff]);)(?P<closing>[{CLOSING}]*)(?=\s)"
_SENTENCE_WIDE = (
    rf"(?:[{_STOPS_WIDE}]|{_WIDE}[.!?…])[{_STOPS_WIDE}.!?…]*(?P<closing_wide>[{_CLOSING_WIDE}]*)"
    rf"(?=[^{_STOPS_WIDE}.!?…{_CLOSING_WIDE}])"
)
_CLAUSE = rf"[,;:–—،؛·][{CLOSING}]*(?=\s)"
_CLAUSE_WIDE = rf"(?:[，、；：､]|{_WIDE}[,;:])[{_CLOSING_WIDE}]*(?=[^\d{_CLOSING_WIDE}])"
_CLAUSE_THAI = "(?<=[\u0e01-\u0ecd])(?=\\s+[\u0e01-\u0ecd])"
"""Thai and Lao have spaces where others have commas and full stops."""
_END = re.compile(rf"(?P<sentence>{_SENTENCE}|{_SENTENCE_WIDE})|(?P<clause>{_CLAUSE}|{_CLAUSE_WIDE}|{_CLAUSE_THAI})")
_LAST_WORDS = re.compile(r"(?:(?P<before>[^\s]+)\s+)?[(\"'“„«‘\[]*(?P<word>[^\s]*)$")
_LOOK_BACK = 80
"""Characters before a full stop that are looked at: longer than any two words that matter."""
_ROMAN = re.compile("[IVX]+$")
_SAYS_GO_ON = "と"
"""Japanese has what was said before `と`: the sentence goes on behind the closing bracket."""

_OPEN = {
    "en": "a an the and or but because so if when that which who whose with without of to from for in on at by as"
    " than my your his her its our their this these those is are was were am be do does did can could will would"
    " shall should may might must have has had not very um uh er hm well like maybe i you we they he she it let's",
    "de": "ein eine einen einem einer der die das den dem des und oder aber weil wenn dass ob mit ohne von zu zum zur"
    " aus für in im an am auf bei als wie mein dein sein ihr unser dieser diese dieses ist sind war waren kann könnte"
    " will würde soll muss hat habe nicht sehr äh ähm hm also vielleicht ich du wir er sie es",
    "fr": "un une le la les des du de et ou mais parce que si quand avec sans pour dans sur à au aux mon ma mes ton"
    " ta est sont était peut veux pas très euh ben je tu nous vous il elle on",
    "es": "un una el la los las del de y o pero porque que si cuando con sin para por en a al mi tu su es son era"
    " puede quiero no muy eh pues yo tú nosotros él ella",
    "it": "un uno una il lo la i gli le del della di e o ma perché che se quando con senza per in a al mio tuo suo è"
    " sono era può voglio non molto eh allora io tu noi lui lei",
}
"""Words behind which nobody ends, by language: more of the sentence must follow."""
_OPEN_WORDS = {language: frozenset(words.split()) for language, words in _OPEN.items()}


class End(NamedTuple):
    """An end of a sentence or a clause. place: characters before it."""

    place: int
    kind: Literal["sentence", "clause"]


def next_end(text: str, since: int = 0) -> tuple[End | None, int]:
    """Find the first end in a text from a place on; returns it, and from where to look again when there is more text.

    text: begins with a sentence. since: as it was returned for the same text, when there was less of it.
    """
    for found in _END.finditer(text, since):
        if found["clause"] is not None:
            return End(found.end(), "clause"), max(found.end(), found.start() + 1)
        answer = _is_sentence(text, found)
        if answer is None:
            return None, found.start()
        if answer:
            return End(found.end(), "sentence"), found.end()
    return None, max(since, _settled(text))


def ends(text: str, place: int) -> bool:
    """Tell whether a sentence ends with the character before a place in a text that is known as a whole."""
    begin = max(0, place - 12)
    whole = f"{text} "
    found = next((each for each in _END.finditer(whole, begin) if each.end() == place), None)
    return found is not None and found["sentence"] is not None and _is_sentence(whole, found) is not False


def leaves_open(text: str, language: str = "") -> bool | None:
    """Tell whether more must follow these words; None: they do not tell.

    language: as `en`; one whose words nobody knows, or none: the words of all languages count.
    """
    stripped = text.rstrip()
    if not stripped or stripped.endswith(("...", "…", ",", "-", "–", ":")):
        return True if stripped else None
    if ends(f"{stripped} ", len(stripped)):
        return False
    *_, last = ("", *re.findall(r"[\w']+", stripped.casefold().replace("’", "'")))
    listed = _OPEN_WORDS.get(language)
    known: Iterable[frozenset[str]] = [listed] if listed is not None else _OPEN_WORDS.values()
    return True if any(last in words for words in known) else None


def _settled(text: str) -> int:
    """The place from which on more text may make an end: the punctuation at its end, and one before."""
    place = len(text)
    while place and not text[place - 1].isalnum() and len(text) - place < _LOOK_BACK:
        place -= 1
    return max(0, place - 1)


def _is_sentence(text: str, found: re.Match[str]) -> bool | None:
    """Tell whether a sentence ends at a match of `_END`; None: the word after it will tell."""
    after = text[found.end() : found.end() + _LOOK_BACK].lstrip()[:1]
    if found["closing_wide"] is not None:
        return not (found["closing_wide"] and after and after in _SAYS_GO_ON)
    if found["closing"] and found["closing"] != "]":
        # `"Stop!" he said`: the quoted sentence is over, the one around it is not.
        return None if not after else not after.islower()
    if found["stops"] != ".":
        return True
    return _is_over(text[max(0, found.start() - _LOOK_BACK) : found.start()], after)


def _is_over(before: str, after: str) -> bool | None:
    """Tell whether a full stop ends a sentence. before: the text before it. after: the next letter, if known."""
    words = _LAST_WORDS.search(before)
    assert words is not None
    word, earlier = words["word"], (words["before"] or "").lower()
    is_first = not before[: words.start("word")].strip()
    tail = word.rpartition("-")[2] if "-" in word and word not in BEFORE_A_WORD else word
    if tail.isdigit():
        if len(word) <= 4 and (earlier in ORDINAL_AFTER or is_first):
            return False  # an ordinal, or the number of an item of a list
        return _if_small(after) if len(tail) <= 2 else True
    if is_first and tail[1:] and tail[0].lower() + tail[1:] in BEFORE_A_WORD:
        return False  # `Vgl. S. 12`
    if tail in BEFORE_A_WORD or (
        len(tail) == 1 and tail.isalpha() and not re.match(f"[{UNSPACED}\uac00-\ud7a3]", tail)
    ):
        return False
    if tail in BEFORE_A_NUMBER:
        return None if not after else not (after.isdigit() or after.islower())
    if tail in BEFORE_EITHER or "." in tail or (_ROMAN.match(tail) and tail != "I"):
        parts = tail.split(".")
        if len(parts) > 1 and not (all(len(each) <= 4 for each in parts) and parts[-1].isalpha()):
            return True  # an address, a number with a decimal point
        return _if_small(after)
    return True


def _if_small(after: str) -> bool | None:
    return None if not after else not (after.islower() or after.isdigit())
