// Needs and provides nothing: stands where a choice needs no code.
