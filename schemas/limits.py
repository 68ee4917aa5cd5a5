"""Limits of what is read."""

LARGEST = 4 * 1024 * 1024
"""Bytes of a message or a document, in whatever form. A block of a thousand behaviors has about 200 kB."""
LARGEST_XML_SENT = 64 * 1024
"""Bytes of XML that is sent over the bus, some 700 behaviors. A kilobyte takes up to 1 ms to read; a server does
nothing else meanwhile, and the realizer has to renew what the body does. JSON and MessagePack take a hundredth."""
