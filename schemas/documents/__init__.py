"""Documents of people: blocks, fragments and feedback, as XML in three dialects and as JSON."""
