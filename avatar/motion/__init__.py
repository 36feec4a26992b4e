"""Motion files of other tools on the avatar's 55 joints: a file is read as a `Source`, which `retarget` turns into a `Motion`."""
