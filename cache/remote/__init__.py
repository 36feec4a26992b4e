"""Results that several machines share: a bucket that speaks S3, or a folder that all see, named by GSAC_REMOTE.

actions/<stage>/<key>.json         records, the text of the store's own
objects/ab/<digest>/<number>       an output as one pack, cut into parts; `pack` says what a pack is
leases/<key>.json                  who computes a key now; `claim` says how long that counts

`bucket` reads and writes, `results` fetches and pushes, `sweep` removes what nobody needs. Objects and records are put only where
none is, so the first result of a key stays. Nothing that is read is believed before its digest is right.
"""
