"""Actions from raw perception: looks, speech, manipulations."""
