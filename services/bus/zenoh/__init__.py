"""The bus over Zenoh. Nothing else imports `zenoh`."""
