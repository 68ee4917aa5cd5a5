"""Commands that make a robot talk, and that plan and explain what it would do."""
