"""The bus: one interface, in memory and over Zenoh."""
