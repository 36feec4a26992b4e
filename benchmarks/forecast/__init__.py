"""How long runs were told to take, and how long they took."""
