"""The content-addressed store: what was computed once, from these inputs by this code, is never computed again.

`key` says what a result depends on (and specifies all hashing), `store` keeps results, `publish` makes them appear
whole or not at all, `lease` lets runs share one store, `gc` and `verify` keep it small and sound. Only the standard
library is used.
"""
