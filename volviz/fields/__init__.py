"""Volume in, array out: statistics, encoding for textures, reduction."""
