"""News of a block: feedback, its net, words that were said, and how it ended."""
