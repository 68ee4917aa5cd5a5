"""Statistics of connection events: counts, delays, pace and engagement."""
