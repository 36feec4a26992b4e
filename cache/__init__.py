"""The content-addressed store: a result of given inputs, parameters and code is computed once and kept.

`key` lists what a result depends on (and specifies all hashing), `store` keeps results, `publish` makes them appear
whole or not at all, `lease` lets runs share one store, `gc` and `verify` keep it small and sound, `remote`
shares results between machines. Only the standard library is used, and obstore where something is shared.
"""
