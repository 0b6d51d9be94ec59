"""Where bodies are: gaps and normals of shapes, and the list of neighbors that may touch within a
step.
"""
