"""The reference policy: chooses the words and gestures that refer to an object.

`phrases` proposes words, `pairs` tells what is understood, `policy` what costs least; `motions` asks the body.
"""
