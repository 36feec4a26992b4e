"""`smplx.method paper`: the published co-registration by Adam, in torch."""
