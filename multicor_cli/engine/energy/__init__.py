"""The energy books: what contacts and walls do to the energy in a step, and whether that closes."""
