"""The Unity package: its C# and shaders, and what packs them together with an avatar."""
