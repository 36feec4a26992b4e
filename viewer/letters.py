"""Bytes as letters of a page: two of 91 letters hold 13 bits, in 8 % less room than base64; letters.js reads them.

The letters are printable ASCII, so that a page may pass through any editor, mail or server that leaves its words alone; no
`<`, `&` or quotation mark is among them.
"""

from __future__ import annotations

import numpy as np

PAIR_BITS, SINGLE_BITS = 13, 6
LETTERS = np.array([ord({"<": "~", "&": "!"}.get(chr(35 + value), chr(35 + value))) for value in range(91)], np.uint8)
"""The letter of each number."""


def encode_letters(data: bytes) -> str:
    """The text that letters.js turns back into the same bytes: bits of a byte lowest first, of a pair its lower digit first."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
    single = 0 < len(bits) % PAIR_BITS <= SINGLE_BITS
    padded = np.pad(bits, (0, -len(bits) % PAIR_BITS)).reshape(-1, PAIR_BITS)
    numbers = padded @ (1 << np.arange(PAIR_BITS))
    text = LETTERS[np.stack([numbers % len(LETTERS), numbers // len(LETTERS)], 1)].tobytes().decode()
    return text[:-1] if single else text
