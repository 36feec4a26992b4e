"""The paper's table: poses given, detections left alone, the paper's fill and ours, on clips in which a hand is hidden."""
