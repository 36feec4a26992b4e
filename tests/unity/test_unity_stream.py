"""Messages of the package's live pose stream, JSON and OSC: what is taken, what is refused and why; the README's sender."""

import json
import random
import re
import socket
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.rigged import RiggedAvatar

pytestmark = pytest.mark.slow

MIRROR = np.diag([-1.0, 1, 1])


def word(text):
    return text.encode() + b"\0" * (4 - len(text) % 4)


def osc(address, *arguments, tags=None):
    """An OSC message by the words of its 1.0 specification; True and False have no bytes."""
    letters, raw = "", b""
    for a in arguments:
        if isinstance(a, bool):
            letters += "T" if a else "F"
        elif isinstance(a, str):
            letters, raw = letters + "s", raw + word(a)
        elif isinstance(a, bytes):
            letters, raw = letters + "b", raw + struct.pack(">i", len(a)) + a + b"\0" * (-len(a) % 4)
        else:
            letter = "i" if isinstance(a, int) else "f"
            letters, raw = letters + letter, raw + struct.pack(">" + letter, a)
    return word(address) + word("," + letters if tags is None else tags) + raw


def bundle(*elements):
    return b"#bundle\0" + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(e)) + e for e in elements)


def read(play, mono, files, tmp_path, messages):
    """messages: name -> bytes. (arrays that each left, name -> fault); a refused one must have left all as it was."""
    folder = tmp_path / "messages"
    folder.mkdir()
    for name, raw in messages.items():
        (folder / name).write_bytes(raw)
    words = dict(line.split() for line in play("messages", files / "figure.gsac", folder, tmp_path / "out").splitlines())
    got = mono.arrays(tmp_path / "out")
    assert words.keys() == messages.keys()
    for name, fault in words.items():
        assert np.isfinite(got[f"{name}.rotation"]).all() and np.isfinite(got[f"{name}.weights"]).all()
        if fault != "None":
            np.testing.assert_array_equal(got[f"{name}.rotation"].reshape(-1, 4), np.tile([0, 0, 0, 1], (55, 1)))
            assert not got[f"{name}.weights"].any() and not got[f"{name}.transl"].any()
    return got, words


def damaged(raw, count, seed):
    """The bytes with some of them changed, two in three also cut short."""
    damage, out = random.Random(seed), {}
    for n in range(count):
        wrong = bytearray(raw)
        for _ in range(3):
            wrong[damage.randrange(len(wrong))] = damage.randrange(256)
        out[f"damaged_{n}"] = bytes(wrong[:damage.randrange(len(wrong))] if n % 3 else wrong)
    return out


def test_a_pose_stream_is_taken_from_the_network_and_smoothed(play, files):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two:
        for probe in (one, two):
            probe.bind(("127.0.0.1", 0))
        ports = [probe.getsockname()[1] for probe in (one, two)]
    *lines, moved = play("stream", files / "figure.gsac", *ports).splitlines()
    assert moved == "moved 1", "a port that is set while the stream is enabled is listened to, the old one no more"
    assert lines[0] == "Messages taken = 2, Refused: Kind = 1, Refused: Truncated = 1"
    degrees, weight = np.array([line.split() for line in lines[1:]], float).T
    assert 5 < degrees[0] < 40 and (np.diff(degrees) > 0).all(), "softly"
    assert abs(degrees[-1] - np.degrees(1.5)) < .1 and abs(weight[-1] - .8) < 1e-3


def test_pose_messages_are_read_in_every_form_and_nonsense_is_refused_by_name(play, mono, files, tmp_path):
    rng = np.random.default_rng(4)
    body, hand, orient = rng.normal(size=63), rng.normal(size=45), np.array([3.0, .2, -.1])
    good = {
        "arrays": {"body_pose": list(body), "left_hand_pose": list(hand), "transl": [1, 2, 3], "who": {"a": [None, True]}},
        "names": {"joints": {"head": [.1, .2, .3], "tail": [9]}, "expression": {"jawOpen": .25, "sneeze": 1}},
        "row": {"expression": [.1, .2]}, "empty": {},
        "camera": {"global_orient": list(orient), "transl": [.1, .2, 3], "camera": True}}
    bad = {"Form": ["{\"transl\": [1, 2, \"3\"]}", "{\"transl\": [NaN, 0, 0]}", "{} x", "{}\0", "{1: 2}"],
           "Numbers": ["{\"body_pose\": [1, 2]}", "{\"transl\": []}", "{\"transl\": [1, 2, 3, 4]}"],
           "Truncated": ["{\"transl\": [1, 2, 3]", "", "{\"x", "{\"x\\"],
           "Value": ["{\"transl\": [1e9, 0, 0]}", "{\"transl\": [" + "9" * 60000 + ",0,0]}"],
           "Depth": ["{\"x\": " + "[" * 60000], "Kind": ["[1]", "hello", "\u00ff"]}
    bad = {f"{fault}_{n}": text.encode() for fault, texts in bad.items() for n, text in enumerate(texts)}
    got, words = read(play, mono, files, tmp_path, {name: json.dumps(message).encode() for name, message in good.items()} | bad)
    assert {name: word for name, word in words.items() if word != ("None" if name in good else name.split("_")[0])} == {}

    def turns(name):
        return Rotation.from_quat(got[f"{name}.rotation"].reshape(-1, 4)).as_matrix()

    def smplx(vector):
        return MIRROR @ Rotation.from_rotvec(vector).as_matrix() @ MIRROR

    np.testing.assert_allclose(turns("arrays")[1:22], [smplx(v) for v in body.reshape(-1, 3)], atol=1e-5)
    np.testing.assert_allclose(turns("arrays")[25:40], [smplx(v) for v in hand.reshape(-1, 3)], atol=1e-5)
    np.testing.assert_allclose(got["arrays.transl"], [-1, 2, 3])
    np.testing.assert_allclose(turns("names")[15], smplx([.1, .2, .3]), atol=1e-5)
    np.testing.assert_allclose(got["names.weights"], [.25, 0])
    np.testing.assert_allclose(got["row.weights"], [.1, .2])
    avatar, upright = RiggedAvatar.read(files / "figure.gsac"), np.diag([1.0, -1, -1])
    np.testing.assert_allclose(turns("camera")[0], MIRROR @ upright @ Rotation.from_rotvec(orient).as_matrix() @ MIRROR, atol=1e-5)
    pelvis = avatar.joints[0]
    np.testing.assert_allclose(got["camera.transl"], MIRROR @ (upright @ (pelvis + [.1, .2, 3]) - pelvis), atol=1e-5)


def test_osc_messages_and_bundles_mean_what_the_json_message_means(play, mono, files, tmp_path):
    rng = np.random.default_rng(4)
    body, hand, orient, shift = rng.normal(size=63), rng.normal(size=45), [3.0, .2, -.1], [.1, .2, 3.0]
    pairs = {
        "groups": ({"body_pose": list(body), "left_hand_pose": list(hand), "transl": [1, 2, 3]},
                   bundle(osc("/gsac/body_pose", *body), bundle(osc("/gsac/left_hand_pose", *hand)),
                          osc("/gsac/transl", 1.0, 2.0, 3))),
        "names": ({"joints": {"head": [.1, .2, .3], "left_index1": [0, 0, .5]}, "expression": {"jawOpen": .25}},
                  bundle(osc("/gsac/joint/head", .1, .2, .3), osc("/gsac/joint/left_index1", 0, False, .5),
                         osc("/gsac/joint/tail", 1.0), osc("/gsac/expression/JawOpen", .25), osc("/gsac/expression/sneeze", "x"))),
        "row": ({"expression": [.1, .2]}, osc("/gsac/expression", .1, .2)),
        "camera": ({"global_orient": orient, "transl": shift, "camera": True},
                   bundle(osc("/gsac/camera", True), osc("/gsac/global_orient", *orient), osc("/gsac/transl", *shift))),
        "turned": ({"global_orient": orient, "camera": True}, bundle(osc("/gsac/global_orient", *orient), osc("/gsac/camera", 1))),
        "still": ({"camera": True}, osc("/gsac/camera", True)),
        "nothing": ({}, bundle()),
        "others": ({}, bundle(osc("/avatar/x", "word", b"blob!", 1), osc("/gsac/unknown"), word("/old"),
                              osc("/tags", tags=",[NI]")))}
    messages = {f"json_{name}": json.dumps(pair[0]).encode() for name, pair in pairs.items()}
    got, words = read(play, mono, files, tmp_path, messages | {f"osc_{name}": pair[1] for name, pair in pairs.items()})
    assert set(words.values()) == {"None"}, words
    for name in pairs:
        for part in ("rotation", "transl", "weights"):
            np.testing.assert_allclose(got[f"osc_{name}.{part}"], got[f"json_{name}.{part}"], atol=1e-6, err_msg=f"{name}.{part}")
    assert abs(got["json_groups.rotation"].reshape(-1, 4)[1:22, :3]).max() > .1
    np.testing.assert_allclose(got["osc_still.rotation"].reshape(-1, 4), np.tile([0, 0, 0, 1], (55, 1)))
    np.testing.assert_allclose(got["osc_turned.rotation"], got["osc_camera.rotation"], atol=1e-6)


def test_the_writer_of_these_tests_gives_the_bytes_that_the_specification_of_osc_prints():
    first = osc("/oscillator/4/frequency", 440.0)
    assert first.hex() == "2f6f7363696c6c61746f722f342f6672657175656e6379002c66000043dc0000"
    second = osc("/foo", 1000, -1, "hello", 1.234, 5.678)
    assert second.hex() == "2f666f6f000000002c69697366660000000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d"


def test_what_motion_capture_programs_send_by_vmc_turns_unitys_bones(play, mono, files, tmp_path):
    turn, curl = Rotation.from_rotvec([.2, -.4, 1.1]).as_quat(), Rotation.from_rotvec([0, .3, 0]).as_quat()
    place = [.1, 1.2, -.3]
    sent = bundle(osc("/VMC/Ext/OK", 1), osc("/VMC/Ext/T", 12.5), osc("/VMC/Ext/Root/Pos", "root", *place, 0.0, 0.0, 0.0, 1.0),
                  osc("/VMC/Ext/Bone/Pos", "LeftLowerArm", *place, *(2 * turn)),
                  osc("/VMC/Ext/Bone/Pos", "RightLittleDistal", *place, *curl),
                  osc("/VMC/Ext/Bone/Pos", "Tail", *place, 0.0, 0.0, 0.0, 0.0), osc("/VMC/Ext/Blend/Val", "JawOpen", .75),
                  osc("/VMC/Ext/Blend/Val", "Joy", 1.0), osc("/VMC/Ext/Blend/Apply"))
    zero = osc("/VMC/Ext/Bone/Pos", "Hips", *place, 0.0, 0.0, 0.0, 0.0)
    got, words = read(play, mono, files, tmp_path, {"vmc": sent, "zero": zero, "short": osc("/VMC/Ext/Bone/Pos", "Hips", 1.0)})
    assert words == {"vmc": "None", "zero": "Value", "short": "Numbers"}
    expected = np.tile([0.0, 0, 0, 1], (55, 1))
    names = RiggedAvatar.read(files / "figure.gsac").joint_names
    expected[names.index("left_elbow")], expected[names.index("right_pinky3")] = turn, curl
    np.testing.assert_allclose(got["vmc.rotation"].reshape(-1, 4), expected, atol=1e-6)
    np.testing.assert_allclose(got["vmc.weights"], [.75, 0])
    assert not got["vmc.transl"].any()


def test_hostile_osc_is_refused_by_name_and_leaves_the_pose(play, mono, files, tmp_path):
    good = osc("/gsac/joint/head", .1, .2, .3)
    nested = good
    for _ in range(12):
        nested = bundle(nested)

    def sized(size):
        return b"#bundle\0" + bytes(8) + struct.pack(">i", size) + good

    bad = {
        "Truncated": [good[:-4], good[:-1], b"/gsa", b"/gsac/joint/head", sized(len(good) + 4), sized(2 ** 31 - 1),
                      sized(len(good) - 2),
                      osc("/x", tags=",s") + b"abcd", osc("/x", tags=",b") + struct.pack(">i", 2 ** 31 - 1),
                      osc("/x", tags=",b") + struct.pack(">i", -8), osc("/x", tags=",ffffffffffff"), b"/x\0\0,fff"],
        "Form": [b"#bundle\0", b"#bundlf\0" + bytes(8), sized(0), sized(-4), b"/x\0\0f\0\0\0" + bytes(4), osc("/x", tags=",?"),
                 good + bytes(4), bundle(good) + struct.pack(">i", -4), bundle(b"abcd")],
        "Numbers": [osc("/gsac/joint/head", .1, .2), osc("/gsac/joint/head", .1, .2, .3, .4), osc("/gsac/body_pose", *np.zeros(62)),
                    osc("/gsac/body_pose", *np.zeros(3000)), osc("/gsac/expression", .1), osc("/gsac/transl", "1", "2", "3"),
                    word("/gsac/transl"), bundle(good, osc("/gsac/camera"))],
        "Value": [osc("/gsac/transl", np.nan, 0.0, 0.0), osc("/gsac/transl", 1e9, 0.0, 0.0), osc("/gsac/camera", np.inf),
                  osc("/gsac/transl", tags=",hhd") + struct.pack(">qqd", -2 ** 62, 1, 1.0),
                  bundle(good, osc("/gsac/transl", 2e3, 0.0, 0.0))],
        "Depth": [nested]}
    messages = {f"{fault}_{n}": raw for fault, raws in bad.items() for n, raw in enumerate(raws)}
    whole = bundle(osc("/gsac/body_pose", *np.ones(63)), osc("/VMC/Ext/Bone/Pos", "Hips", *np.ones(7)),
                   osc("/gsac/expression/jawOpen", 1.0), osc("/else", b"blob", "word", 3, True))
    messages |= damaged(whole, 400, 2) | {f"noise_{n}": random.Random(n).randbytes(4 * n) for n in range(100)}
    messages |= {f"bundle_{n}": b"#bundle\0" + random.Random(n).randbytes(4 * n) for n in range(2, 60)}
    got, words = read(play, mono, files, tmp_path, messages)
    assert {name: fault for name, fault in words.items() if name.split("_")[0] in bad and fault != name.split("_")[0]} == {}
    assert len({fault for name, fault in words.items() if name.startswith("damaged")}) >= 4


def test_the_senders_of_the_readme_are_understood(play, mono, files, tmp_path, package):
    readme = (package / "README.md").read_text()
    sender = re.search(r"```python\n(.*?)```", readme, re.DOTALL)[1]
    sent = []

    class Socket:
        def sendto(self, raw, address):
            assert address == ("127.0.0.1", 9000)
            sent.append(raw)

    names = {"socket": type("socket", (), {"socket": lambda *_: Socket(), "AF_INET": 0, "SOCK_DGRAM": 0}),
             "time": type("time", (), {"sleep": lambda _: None})}
    body = "\n".join(line for line in sender.splitlines() if not line.startswith("import "))
    exec(body, {"math": __import__("math"), "struct": struct, "json": json} | names)
    assert len(sent) > 30
    got, words = read(play, mono, files, tmp_path, {"first": sent[0], "later": sent[20]})
    assert set(words.values()) == {"None"}
    names = RiggedAvatar.read(files / "figure.gsac").joint_names
    elbow = [got[f"{which}.rotation"].reshape(-1, 4)[names.index("left_elbow")] for which in ("first", "later")]
    assert abs(elbow[0][1]) > .3 and abs(elbow[0] - elbow[1]).max() > .1 and got["later.weights"][0] > 0
    form = json.loads(re.sub(r"\[(\d+) numbers\]|\[(\d+)\]", lambda m: json.dumps([0] * int(m[1] or m[2])),
                             re.search(r"```json\n(.*?)```", readme, re.DOTALL)[1]))
    (tmp_path / "form").mkdir()
    assert read(play, mono, files, tmp_path / "form", {"form": json.dumps(form).encode()})[1] == {"form": "None"}
