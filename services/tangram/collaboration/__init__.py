"""The collaboration manager of the tangram: performs its plan through the public client alone."""
