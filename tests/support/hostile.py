"""Damaged and hostile `.gsac` files, each with the faults that a reader may give it (docs/gsac-format.md)."""

import copy
import json
import random
import zlib

import numpy as np

from gsac.avatar.gsac_file.container import HEADER, MAGIC, VERSION, pack, unpack


def parts(data):
    start = HEADER.size + HEADER.unpack_from(data)[2]
    return json.loads(data[HEADER.size:start]), data[start:]


def built(head, body):
    """A file whose header and checksum are right, whatever its head says."""
    text = head if isinstance(head, bytes) else json.dumps(head).encode()
    text += b" " * (-(HEADER.size + len(text)) % 16)
    rest = text + body
    return HEADER.pack(MAGIC, VERSION, len(text), HEADER.size + len(rest), zlib.crc32(rest), 0) + rest


def as_stored(data):
    """Head without its table of blocks, blocks as stored, their scales."""
    head, body = parts(data)
    plain = {k: {n: v for n, v in e.items() if n != "scale"} for k, e in head["blocks"].items()}
    stored = {k: v.copy() for k, v in unpack(built(head | {"blocks": plain}, body))[1].items()}
    scales = {k: e["scale"] for k, e in head["blocks"].items() if "scale" in e}
    return {k: v for k, v in head.items() if k != "blocks"}, stored, scales


def with_values(data, name, value):
    """The avatar with the second row of a block set to `value`, as stored."""
    head, stored, scales = as_stored(data)
    stored[name][1] = value
    return pack(head, stored, scales)


def with_block(data, name, array, scale=None):
    """The avatar with one more block, or another one of that name."""
    head, stored, scales = as_stored(data)
    return pack(head, stored | {name: array}, scales if scale is None else scales | {name: scale})


def files(data):
    """Name -> (bytes, fault words one of which is right)."""
    out = {"whole": (data, {"ok"})}
    for cut in [0, 1, 7, 8, 12, 31, 32, 33, 4000, len(data) // 2, len(data) - 1]:
        out[f"cut{cut}"] = data[:cut], {"truncated"} if cut else {"not_gsac"}
    out["longer"] = data + b"\0", {"oversized"}
    out["said_huge"] = data[:16] + (1 << 60).to_bytes(8, "little") + data[24:], {"oversized"}
    out["said_short"] = data[:16] + (64).to_bytes(8, "little") + data[24:], {"oversized"}
    out["version"] = data[:8] + b"\2\0\0\0" + data[12:], {"version"}
    out["png"] = b"\x89PNG\r\n\x1a\n" + data[8:], {"not_gsac"}
    out["text_mode"] = data.replace(b"\r\n", b"\n", 1), {"not_gsac"}
    out["flipped"] = data[:500] + bytes([data[500] ^ 4]) + data[501:], {"checksum"}
    for size in (0xffffffff, 1 << 21, len(data), 17):
        out[f"head_size{size}"] = data[:12] + size.to_bytes(4, "little") + data[16:], {"head"}
    for n, text in enumerate([b"", b"[]", b"{", b"[" * 100_000, b'{"blocks":{},"x":NaN}', b"\xff\xfe", b'{"blocks":[]}',
                              b'{"a":"' + b"x" * 2000, b'{"blocks":{}', b'{"blocks":{}}x', b'{"blocks" {}}', b'{"x":1e}',
                              b'{"x":01}', b'{"x":"\x01"}', b'{"x":"\\q"}', b"null", b'{"x":-}']):
        out[f"json{n}"] = built(text, b""), {"head"}
    head, body = parts(data)
    for around, words in ((100, {"ok"}), (101, {"head"}), (2000, {"head"})):
        for kind, (left, right) in {"lists": ("[", "]"), "tables": ('{"x":', "}")}.items():
            inner = left * (around - 1) + "1" + right * (around - 1)  # the head is the first around it
            out[f"{around}_{kind}"] = built(json.dumps(head)[:-1].encode() + f',"x":{inner}}}'.encode(), body), words
    for n, change in enumerate([
            {"offset": -16}, {"offset": 8}, {"offset": 1 << 60}, {"offset": 1e300}, {"offset": True}, {"offset": None},
            {"offset": "0"}, {"shape": [1 << 40, 3]}, {"shape": [-1, 3]}, {"shape": [1 << 26] * 4}, {"shape": "x"},
            {"shape": [2] * 60}, {"shape": [1.5]}, {"shape": [True]}, {"dtype": "f128"}, {"dtype": "u16"}, {"dtype": None},
            {"dtype": []}, {"dtype": "__proto__"}, {"scale": 1e308}, {"scale": "1"}, {"scale": 0}, {"scale": None},
            {"shape": [1 << 26, 0, 3]}, {"shape": [3]}, {"shape": [], "scale": 2},
            {"offset": head["blocks"]["gaussian.rgb"]["offset"]}]):
        blocks = copy.deepcopy(head["blocks"])
        blocks["gaussian.mu"] |= change
        out[f"block{n}"] = built(head | {"blocks": blocks}, body), {"block"}
    for name in head["blocks"]:
        out[f"without_{name}"] = built(head | {"blocks": {k: v for k, v in head["blocks"].items() if k != name}}, body), {"block"}
    many = {f"x{i}": {"offset": 0, "dtype": "u8", "shape": [0]} for i in range(5000)}
    out["many_blocks"] = built(head | {"blocks": head["blocks"] | many}, body), {"block"}
    for name, value in [("rest.faces", 60000), ("skin.index", 200), ("expression.vertex", 60000), ("expression.start", 60000),
                        ("gaussian.face", 60000), ("skin.weight", 65535), ("rest.vertices", np.nan), ("gaussian.mu", np.inf),
                        ("gaussian.quat", 0), ("rest.joints", -np.inf), ("clip.wave.transl", np.nan)]:
        out[f"value_{name}"] = with_values(data, name, value), {"value"}
    for n, array in enumerate([np.ones((3, 4)), np.ones(12), np.ones((4, 3, 1)), np.ones((0, 3)), np.ones((4, 4)), np.array(1.0)]):
        out[f"light_shape{n}"] = with_block(data, "light", array.astype(np.float32)), {"block"}
    for kind in (np.uint8, np.int16, np.uint32):
        out[f"light_{kind.__name__}"] = with_block(data, "light", np.ones((4, 3), kind)), {"block"}
    for n, value in enumerate([np.nan, np.inf, -np.inf]):
        out[f"light_value{n}"] = with_block(data, "light", np.full((4, 3), value, np.float32)), {"value"}
    out["light_whole"] = with_block(data, "light", np.full((4, 3), .5, np.float32)), {"ok"}
    out["light_f16"] = with_block(data, "light", np.full((4, 3), .5, np.float16)), {"ok"}
    out["light_scaled"] = with_block(data, "light", np.full((4, 3), -7, np.int16), 1e-2), {"ok"}
    out |= corrected(data, head)
    out["unknown_block"] = with_block(data, "mirror", np.full((2, 2), np.nan, np.float32)), {"ok"}
    joints = head["joints"]
    for n, change in enumerate([
            {"joints": None}, {"joints": {"names": ["a"], "parents": [0]}}, {"joints": {"names": [], "parents": []}},
            {"joints": joints | {"parents": [-1, *range(1, 55)]}}, {"joints": joints | {"parents": [-1] * 55}},
            {"joints": joints | {"parents": [-1, *[1 << 70] * 54]}}, {"joints": joints | {"parents": 7}},
            {"joints": joints | {"names": ["a"] * 55}},
            {"levels": []}, {"levels": [{"prefix": 3, "count": 1}]}, {"levels": [{"prefix": "gaussian", "count": 1}]},
            {"levels": head["levels"][:1] * 2}, {"levels": head["levels"][:1] + [{"prefix": "gaussian1", "count": 1}]},
            {"levels": {}}, {"levels": [3]}, {"poses": {"T": {"nobody": [0, 0, 0]}}}, {"poses": {"T": 1}},
            {"poses": {"T": {"head": [0, 0]}}}, {"poses": {"T": {"head": [0, "0", 0]}}}, {"poses": {"T": {"head": [1e9, 0, 0]}}},
            {"poses": []}, {"clips": [{}]}, {"clips": 3}, {"clips": [1]}, {"clips": [head["clips"][0]] * 2},
            {"clips": [head["clips"][0] | {"fps": 0}]}, {"clips": [head["clips"][0] | {"fps": "20"}]},
            {"clips": [head["clips"][0] | {"joints": ["tail"]}]}, {"clips": [head["clips"][0] | {"loop": 1}]},
            {"clips": [head["clips"][0] | {"name": "other"}]}, {"expressions": "abc"}, {"expressions": [1, 2]},
            {"licence": {"x": 1}}, {"licence": []}, {"provenance": None}, {"format": "other"}, {"format": None},
            {"ground": "0"}, {"ground": None}, {"ground": True}, {"ground": 1e7}, {"blend": None}, {"blend": []},
            {"blend": {"low_pass_px2": ""}}, {"blend": {"low_pass_px2": -1}}, {"blend": {"alpha_max": 1.5}},
            {"blend": {"alpha_min": 0}}, {"blend": {"alpha_min": [1]}}, {"blend": {"low_pass_energy": 1}},
            {"blend": {"low_pass_energy": None}}, {"blend": {"low_pass_energy": "true"}},
            *({"levels": [*head["levels"][:1], head["levels"][1] | {"max_height_px": height}]}
              for height in (0, -1, 0.5, 1e7, 10 ** 400, True, "270", [270]))]):
        out[f"head{n}"] = built(head | change, body), {"head", "value", "block"}
    for n, change in enumerate([{"blend": {"low_pass_energy": True}}, {"blend": {"low_pass_px2": 0, "low_pass_energy": True}},
                                {"levels": [level | {"max_height_px": None} for level in head["levels"]]},
                                {"levels": [level | {"max_height_px": 270 + n} for n, level in enumerate(head["levels"])]},
                                {"blend": {}}, {"blend": {"alpha_min": 1, "other": None}}, {"ground": 10 ** 6}, {"x": 10 ** 400},
                                {"x": {"__proto__": [1e308, -10 ** 400]}}]):
        out[f"odd{n}"] = built(head | change, body), {"ok"}
    out["no_drawing"] = built({k: v for k, v in head.items() if k not in ("ground", "blend")}, body), {"ok"}
    return out


def corrected(data, head):
    """Files with pose correctives, whole and broken."""
    V, joint = head["blocks"]["rest.vertices"]["shape"][0], np.array([3, 18, 54], np.uint8)
    start, delta = np.array([*[0] * V, 3], np.uint32), np.zeros((3, 3, 9), np.float16)
    good = {"start": start, "joint": joint, "delta": delta}
    wide = {"joint": joint.astype(np.uint32), "delta": delta.astype(np.float32)}
    falls = np.where(np.arange(V + 1) == V // 2, 2, start).astype(np.uint32)
    bad = {"good": ({}, {"ok"}), "root": ({"joint": joint * 0}, {"ok"}), "wide": (wide, {"ok"}),
           "joint": ({"joint": joint + 1}, {"value"}), "real": ({"joint": joint.astype(np.float32)}, {"block"}),
           "lacks": ({"joint": None}, {"block"}), "short": ({"start": start[1:]}, {"block"}),
           "falls": ({"start": falls}, {"value"}), "ends": ({"start": start - (start > 0)}, {"value"}),
           "begins": ({"start": np.maximum(start, 1)}, {"value"}),
           "huge": ({"start": start * 2**30}, {"value"}), "fewer": ({"delta": delta[1:]}, {"block"}),
           "flat": ({"delta": delta.reshape(3, 27)}, {"block"}), "nan": ({"delta": delta * np.float16(np.nan)}, {"value"}),
           "whole": ({"delta": delta.astype(np.uint8)}, {"block"})}
    out = {}
    for name, (change, words) in bad.items():
        made = data
        for block, array in (good | change).items():
            made = made if array is None else with_block(made, f"corrective.{block}", array)
        out[f"corrective_{name}"] = made, words
    return out


def fuzzed(data, count, seed=0):
    """Files damaged at a few places of head or blocks, with a repaired checksum: the reader's own checks have to find it."""
    rng = random.Random(seed)
    head_end = HEADER.size + HEADER.unpack_from(data)[2]
    out = {}
    for n in range(count):
        damaged = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            damaged[rng.randrange(HEADER.size, head_end if rng.random() < .8 else len(data))] = rng.randrange(256)
        damaged[24:28] = zlib.crc32(damaged[HEADER.size:]).to_bytes(4, "little")
        out[f"fuzz{n}"] = bytes(damaged)
    return out


ODD = [None, True, 0, -1, 1.5, -0.0, 1e308, 1e-320, 2 ** 31, 2 ** 53, 2 ** 63, 10 ** 400, "", "x", "__proto__", "\u0000", [], {},
       [[]], [None], {"a": 1}, [1] * 5]


def places(node, above=()):
    """The place of every value in a JSON document; of a list its first eight."""
    yield above
    rows = node.items() if isinstance(node, dict) else enumerate(node[:8]) if isinstance(node, list) else ()
    for key, value in rows:
        yield from places(value, (*above, key))


def rewritten(data, count, seed=0):
    """Well-formed files in whose head one value is an odd one, another place's, gone, or there under a strange name."""
    rng, (head, body) = random.Random(seed), parts(data)
    everywhere, out = [place for place in places(head) if place], {}

    def at(document, place):
        for key in place:
            document = document[key]
        return document

    for n in range(count):
        changed, place = copy.deepcopy(head), rng.choice(everywhere)
        holder, key, kind = at(changed, place[:-1]), place[-1], rng.random()
        if kind < .6:
            holder[key] = rng.choice(ODD)
        elif kind < .75:
            holder[key] = copy.deepcopy(at(head, rng.choice(everywhere)))
        elif kind < .85 or not isinstance(holder, dict):
            del holder[key]
        else:
            holder[rng.choice(["__proto__", "constructor", "blocks", "light", "x"])] = rng.choice(ODD)
        out[f"rewritten{n}"] = built(changed, body)
    return out
