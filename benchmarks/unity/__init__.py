"""The Unity package's shaders on a GPU without Unity: compiled by glslang, run by Vulkan, each pass timed."""
