"""What to build in a cell: one extractor per file, one row here."""
