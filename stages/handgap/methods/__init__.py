"""What fills a hidden hand: one file a method, named as `handgap.method` names it; `fill.METHODS` is the list."""
