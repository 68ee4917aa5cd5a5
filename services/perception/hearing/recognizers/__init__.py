"""Adaptors for engines that understand speech; each is found by its entry point, and imported when it is named."""
