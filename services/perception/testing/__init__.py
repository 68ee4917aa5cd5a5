"""The contract of perception: laws that what a source of head poses tells has to keep, judged on what it told.

laws.py        what each law asks, and where it is broken. Pure
gathering.py   what a source has told: from a recording, or by letting it look now
"""
