"""From raw perception to actions: looks, speech, hands."""
