"""Where bodies are: gaps and normals of shapes, and neighbors that may touch within a step."""
