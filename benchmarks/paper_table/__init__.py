"""The paper's table in its own shape: no hand fill, the paper's fill and ours, on clips with a hand hidden for a while."""
