"""Motion from other tools, put on the avatar's own 55 joints: a file -> `Source` -> `retarget` -> `Motion`."""
