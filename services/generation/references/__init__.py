"""The reference policy: chooses the words and gestures that refer to an object."""
