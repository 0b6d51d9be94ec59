"""Tables computed from a run directory."""
