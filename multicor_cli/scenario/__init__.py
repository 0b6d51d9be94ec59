"""What the user said: models of the TOML file, loading, positions of problems."""
