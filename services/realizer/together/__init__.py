"""Live blocks among each other: ties, parts that change hands, holds, and planning beside those that run.

`planning` refuses what is too large.
"""
