"""Damaged copies of a whole file, by a seed: of its bytes, of its words, and of what an npz says of its arrays."""

import io
import random
import re
import zipfile

import numpy as np

EXTREME = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 62, (1 << 64) - 1]
WORDS = ["", "0", "-1", "1e9", "1e308", "-1e308", "nan", "inf", "99999999999999999999", "9" * 5000, "true", "null", "[]", "{}",
         "[[[[[[[[", '"x"', "x" * 300, "\0", "\udcff", "%", "../x", "*a", "&a", "!!int", "1:30", "010", "é"]
NUMBER_OR_WORD = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|\w+|[^\w\s]")


def bytes_of(data, rng):
    """The file with one to four places damaged: flipped, overwritten by an extreme number, cut out, doubled, or its end missing."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if not out:
            break
        # Most of what a reader believes stands at the beginning.
        at = rng.randrange(len(out)) if rng.random() < .5 else rng.randrange(min(len(out), 512))
        kind = rng.random()
        if kind < .4:
            out[at] = rng.randrange(256)
        elif kind < .7:
            size = rng.choice([1, 2, 4, 8])
            out[at:at + size] = (rng.choice(EXTREME) % (1 << 8 * size)).to_bytes(size, rng.choice(["big", "little"]))
        elif kind < .8:
            del out[at:at + rng.randint(1, 64)]
        elif kind < .9:
            out[at:at] = out[at:at + rng.randint(1, 64)]
        else:
            del out[at:]
    return bytes(out)


def words_of(data, rng):
    """The text with one to four of its words or signs replaced by odd ones or others of the file, gone, or repeated."""
    text = data.decode("utf-8", "surrogateescape")
    for _ in range(rng.randint(1, 4)):
        places = [NUMBER_OR_WORD.search(text, rng.randrange(len(text) + 1)) for _ in range(2)]
        if None in places:
            continue
        (start, end), other, kind = places[0].span(), places[1].span(), rng.random()
        new = (rng.choice(WORDS) if kind < .5 else text[slice(*other)] if kind < .7 else "" if kind < .85
               else text[start:end] * rng.choice([2, 50]))
        text = text[:start] + new + text[end:]
    return text.encode("utf-8", "surrogateescape")


def either(data, rng):
    """A text damaged in its words, or its bytes."""
    return words_of(data, rng) if rng.random() < .7 else bytes_of(data, rng)


def npz_of(data, rng):
    """An npz one of whose arrays says something else than it holds, or is of another kind; its checksums are right."""
    if rng.random() < .3:
        return bytes_of(data, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members = {name: file.read(name) for name in file.namelist()}
    name = rng.choice(list(members))
    kind = rng.random()
    if kind < .5:
        length = int.from_bytes(members[name][8:10], "little")
        header = words_of(members[name][10:10 + length], rng)[:65000]
        members[name] = members[name][:8] + len(header).to_bytes(2, "little") + header + members[name][10 + length:]
    elif kind < .6:
        members[name] = bytes_of(members[name], rng)
    elif kind < .7:
        del members[name]
    elif kind < .75:
        members[name.removesuffix(".npy")] = members.pop(name)
    else:
        members[name] = npy(rng.choice([
            np.zeros((0,)), np.zeros(()), np.array("x"), np.array([True]), np.full((3, 3), np.nan), np.full(5, 1 << 62),
            np.zeros((2, 2), complex), np.zeros((4, 0, 3)), np.full((2, 63), 1e300), np.zeros((1,) * 20), np.array([b"x"]),
            np.zeros(3, "datetime64[s]"), np.zeros(2, [("a", "f4")])]))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as file:
        for each, content in members.items():
            file.writestr(each, content)
    return out.getvalue()


def npy(array):
    """The bytes of an array as a member of an npz."""
    out = io.BytesIO()
    np.lib.format.write_array(out, array, allow_pickle=False)
    return out.getvalue()


def bomb(shape, dtype="<f8", name="poses"):
    """A small npz whose one array is large when unpacked: zeros of that shape."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file, file.open(f"{name}.npy", "w", force_zip64=True) as member:
        header = {"descr": dtype, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(member, header)
        left, zeros = int(np.prod(shape, dtype=object)) * np.dtype(dtype).itemsize, bytes(1 << 20)
        while left > 0:
            left -= member.write(zeros[:left])
    return out.getvalue()


def mutants(data, damage, count, seed=0):
    """count damaged copies of the file, each by its own number: the same whichever of them are asked for."""
    for number in range(count):
        yield damage(data, random.Random(f"{seed} {number}"))
