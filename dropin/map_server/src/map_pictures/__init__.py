"""Saved maps: reading their files, publishing them."""
