"""What a finished avatar is worth: held-out frames, poses never seen, parts that no frame shows."""
