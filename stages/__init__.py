"""The eight steps from a clip to an avatar. Each is a pure function of declared inputs, parameters and models."""
