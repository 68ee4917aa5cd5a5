"""Abbreviations by what their full stop says of the end of a sentence, for all languages together.

The writer of a streamed text names no language, and a text may mix two; so there is one table. Where a word of one
language is an abbreviation of another, the table has it in that spelling alone: `Di` is a German day.
Full stops inside are written as they are, the last one is left out.
"""

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
