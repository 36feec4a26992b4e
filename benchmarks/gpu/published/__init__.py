"""The paper's training by its published definition, in plain torch: an independent run to compare recipe `paper` with."""
