"""Made-up faces, from which `tools/face_actions.py` measures the face network."""
