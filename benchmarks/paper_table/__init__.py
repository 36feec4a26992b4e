"""The paper's table: no hand fill, the paper's fill and ours, on clips in which a hand is hidden."""
