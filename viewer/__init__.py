"""The web page that shows an avatar: its ES modules, its shaders, and the maker of one file from them."""
