"""The protocols by which other systems were published, on data that `gsac data import` wrote."""
