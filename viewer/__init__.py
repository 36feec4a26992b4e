"""The web page that shows an avatar: its scripts, its shaders, and what makes one file of them."""
