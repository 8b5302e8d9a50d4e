"""Comparing techniques: variants of one scene, their pictures, what they cost and how they err."""
