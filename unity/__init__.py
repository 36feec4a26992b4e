"""The Unity package: its C# and shaders, and the code that packs them together with an avatar."""
