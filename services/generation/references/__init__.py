"""The reference policy: with which words and gestures an object is referred to."""
