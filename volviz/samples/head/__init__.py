"""Anatomy of the sample head, a part a file; `model` puts them together."""
