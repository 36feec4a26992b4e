"""The Unity package's shaders on a GPU without Unity: compiled by glslang, run through Vulkan, each pass timed."""
