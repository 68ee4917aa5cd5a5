"""Packages that offer recognizers are installed as those that offer drivers are."""

from tests.control.test_offers import install as install
