"""LPIPS with random weights of the official shapes, against the formula written out a second time; weights read and refused."""

import json

import numpy as np
import pytest
import torch

from gsac.avatar import weight_file
from gsac.avatar.lpips import NETS, SHIFT, Lpips, gather, shapes
from gsac.avatar.weight_file import WeightsError, read_weights

NAMES = tuple(NETS)


def weights(name, seed=0):
    """Random arrays that keep the features' size from layer to layer."""
    rng = np.random.default_rng(seed)
    return {own: np.float32(rng.random(shape) if own.startswith("lin") else rng.normal(size=shape) * 0.1 if len(shape) == 1
                            else rng.normal(size=shape) * np.sqrt(2 / np.prod(shape[1:])))
            for own, shape in shapes(name).items()}


@pytest.fixture(scope="module", params=NAMES)
def net(request):
    return request.param, weights(request.param)


def images(height=64, width=66, seed=1):
    rng = np.random.default_rng(seed)
    return rng.random((2, height, width, 3))


def plain(name, arrays, a, b):
    """The formula, with torchvision's own layer lists as modules and einsum for the rest."""
    shift, scale = torch.tensor([-.030, -.088, -.188]).double(), torch.tensor([.458, .448, .450]).double()
    conv, relu, pool = torch.nn.Conv2d, torch.nn.ReLU, torch.nn.MaxPool2d
    if name == "lpips-vgg":
        widths, modules, before = [64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512], [], 3
        for width in widths:
            modules += [conv(before, width, 3, padding=1), relu()] if width else [pool(2, 2)]
            before = width or before
        ends = [4, 9, 16, 23, 30]
    else:
        modules = [conv(3, 64, 11, 4, 2), relu(), pool(3, 2), conv(64, 192, 5, padding=2), relu(), pool(3, 2),
                   conv(192, 384, 3, padding=1), relu(), conv(384, 256, 3, padding=1), relu(),
                   conv(256, 256, 3, padding=1), relu()]
        ends = [2, 5, 8, 10, 12]
    features = torch.nn.Sequential(*modules).double()
    features.load_state_dict({own[9:]: torch.tensor(v) for own, v in arrays.items() if own.startswith("features.")})
    total, begin = 0.0, 0
    x, y = (((2 * torch.tensor(image) - 1 - shift) / scale).permute(2, 0, 1)[None] for image in (a, b))
    for k, end in enumerate(ends):
        x, y = features[begin:end](x), features[begin:end](y)
        begin = end
        one, two = (z / z.norm(dim=1, keepdim=True) for z in (x, y))
        total += torch.einsum("c,bchw->hw", torch.tensor(arrays[f"lin{k}"]).double(), (one - two) ** 2).mean()
    return total.item()


def test_the_distance_is_that_of_the_formula_written_out(net):
    name, arrays = net
    a, b = images()
    measured = Lpips(name, arrays).distance(a, b)
    assert measured == pytest.approx(plain(name, arrays, a, b), rel=1e-4)
    assert measured > 0.01


def test_equal_images_have_no_distance_and_order_does_not_matter(net):
    scorer = Lpips(*net)
    a, b = images()
    assert scorer.distance(a, a) == 0
    there, back = scorer.distance(a, b), scorer.distance(b, a)
    assert there == pytest.approx(back, rel=1e-6)
    assert scorer.distance(a, 0.9 * a + 0.1 * b) < there
    assert scorer.distance(a, b, scaled=False) != pytest.approx(there, rel=1e-2)
    assert np.isnan(scorer.distance(a[:60], b[:60]))


def test_the_gradient_is_that_of_finite_differences(net):
    scorer = Lpips(*net)
    image, target = images()
    for scaled in (True, False):
        value, gradient = scorer.gradient(image, target, scaled)
        assert value == pytest.approx(scorer.distance(image, target, scaled), rel=1e-4)
        along, step = gradient / np.linalg.norm(gradient), 1e-7
        above, below = (scorer.gradient(image + sign * step * along, target, scaled)[0] for sign in (1, -1))
        assert (gradient * along).sum() == pytest.approx((above - below) / (2 * step), rel=1e-4)


def test_where_a_network_says_nothing_at_all_the_gradient_is_zero_and_not_nan():
    arrays = weights("lpips-alex")
    arrays |= {own: np.zeros_like(v) - 1 for own, v in arrays.items() if own.endswith("bias")}
    arrays |= {own: np.zeros_like(v) for own, v in arrays.items() if own.endswith(".weight")}
    value, gradient = Lpips("lpips-alex", arrays).gradient(*images())
    assert value == 0 and not gradient.any()


def theirs(arrays, network=True, heads=True, whole=False):
    """As torchvision and the authors call the arrays; whole: as one module of the authors' package does."""
    found = {}
    for own, values in arrays.items():
        if own.startswith("lin"):
            if heads:
                found[f"{own}.model.1.weight"] = torch.tensor(values)[None, :, None, None]
                if whole:
                    found[f"lins.{own[3]}.model.1.weight"] = found[f"{own}.model.1.weight"]
        elif network:
            found[f"net.slice1.{own[9:]}" if whole else own] = torch.tensor(values)
    if network and not whole:
        found["classifier.6.bias"] = torch.zeros(1000)
    if whole:
        found["scaling_layer.shift"] = torch.tensor(SHIFT)[None, :, None, None]
    return found


def test_weights_come_in_every_form_that_users_have(tmp_path):
    arrays = weights("lpips-alex")
    torch.save(theirs(arrays, heads=False), tmp_path / "alexnet.pth", _use_new_zipfile_serialization=False)
    torch.save(theirs(arrays, network=False), tmp_path / "alex.pth")
    torch.save({"state_dict": theirs(arrays, whole=True)}, tmp_path / "module.pt")
    np.savez(tmp_path / "ours.npz", **arrays)
    write_safetensors(tmp_path / "all.safetensors", theirs(arrays, whole=True))
    for files in (["alexnet.pth", "alex.pth"], ["alex.pth", "alexnet.pth"], ["module.pt"], ["ours.npz"], ["all.safetensors"]):
        found = gather("lpips-alex", [tmp_path / file for file in files])
        assert list(found) == list(arrays), files
        for own, values in arrays.items():
            np.testing.assert_array_equal(found[own], values)


def write_safetensors(path, state, cut=0):
    header, blob = {"__metadata__": {"format": "pt"}}, b""
    for name, value in state.items():
        data = value.numpy().tobytes()
        header[name] = {"dtype": "F32", "shape": list(value.shape), "data_offsets": [len(blob), len(blob) + len(data)]}
        blob += data
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + blob[:len(blob) - cut])


def test_half_floats_of_safetensors_are_read(tmp_path):
    values = torch.tensor([1.5, -2.25, 3e3])
    for kind, name in ((torch.float16, "F16"), (torch.bfloat16, "BF16")):
        data = values.to(kind).view(torch.int16).numpy().tobytes()
        text = json.dumps({"x": {"dtype": name, "shape": [3], "data_offsets": [0, 6]}}).encode()
        (tmp_path / "x.safetensors").write_bytes(len(text).to_bytes(8, "little") + text + data)
        np.testing.assert_array_equal(read_weights(tmp_path / "x.safetensors")["x"], values.to(kind).float().numpy())


@pytest.mark.parametrize("spoil, words", [
    (lambda s: s.pop("lin3.model.1.weight"), "lin3 is missing: the heads of lpips-alex.*torchvision's alexnet"),
    (lambda s: s.pop("features.6.bias"), r"features.6.bias is missing: the network"),
    (lambda s: s.update({"features.0.weight": torch.zeros(64, 3, 3, 3)}),
     r"features.0.weight has shape \(64, 3, 3, 3\), lpips-alex has \(64, 3, 11, 11\)"),
    (lambda s: s.update({"features.3.bias": torch.full((192,), torch.nan)}), "features.3.bias is not finite")])
def test_wrong_weights_are_named(tmp_path, spoil, words):
    state = theirs(weights("lpips-alex"))
    spoil(state)
    torch.save(state, tmp_path / "w.pth")
    with pytest.raises(WeightsError, match=words):
        gather("lpips-alex", [tmp_path / "w.pth"])


class Trap:
    def __reduce__(self):
        return print, ("code of a file was run",)


def test_files_that_are_no_weights_are_refused_and_their_code_is_not_run(tmp_path, capsys):
    torch.save({"x": Trap()}, tmp_path / "trap.pth")
    (tmp_path / "text.npz").write_text("no weights")
    (tmp_path / "text.safetensors").write_text("no weights")
    (tmp_path / "text.pth").write_text("no weights")
    write_safetensors(tmp_path / "cut.safetensors", {"x": torch.zeros(9)}, cut=4)
    np.savez(tmp_path / "objects.npz", x=np.array([Trap()], object))
    for file in ("trap.pth", "text.npz", "text.safetensors", "text.pth", "cut.safetensors", "objects.npz", "none.pth", "kind.onnx"):
        with pytest.raises(WeightsError, match=file):
            read_weights(tmp_path / file)
    assert "code of a file" not in capsys.readouterr().out


def safetensors(head, data=bytes(64)):
    text = json.dumps(head).encode()
    return len(text).to_bytes(8, "little") + text + data


def test_weights_that_say_more_than_their_file_holds_are_refused_with_the_bound(tmp_path, monkeypatch):
    entry = {"dtype": "F32", "shape": [16], "data_offsets": [0, 64]}
    (tmp_path / "twice.safetensors").write_bytes(safetensors({"a": entry, "b": entry}))
    (tmp_path / "list.safetensors").write_bytes(safetensors([1]))
    (tmp_path / "long.safetensors").write_bytes((17 << 20).to_bytes(8, "little") + bytes(17 << 20))
    torch.save({"x": torch.zeros(1).expand(1 << 40)}, tmp_path / "wide.pth")
    said = {"twice.safetensors": "b lies where another array lies", "list.safetensors": "cannot be read",
            "long.safetensors": "its header has 17825792 bytes; at most 16777216",
            "wide.pth": "1099511627776 numbers; at most 167772160"}
    for file, words in said.items():
        with pytest.raises(WeightsError, match=f"{file}.*{words}"):
            read_weights(tmp_path / file)
    monkeypatch.setattr(weight_file, "MOST_BYTES", 100)
    torch.save({"x": torch.zeros(100)}, tmp_path / "large.pth")
    with pytest.raises(WeightsError, match=r"large\.pth.* bytes when unpacked; at most 100 are read"):
        read_weights(tmp_path / "large.pth")


def test_a_network_in_another_precision_says_nearly_the_same_and_its_slope_points_the_same_way():
    """Rounding puts features near zero on the other side of ReLU, so slopes differ by far more than values do."""
    scorer = Lpips("lpips-alex", weights("lpips-alex"))
    image, target = np.float32(images(96, 80))
    value, slope = scorer.gradient(image, target, scaled=False)
    for precision, near, along in ((torch.float32, 1e-5, 0.9999), (torch.bfloat16, 0.02, 0.8)):
        moved = torch.from_numpy(image).requires_grad_()
        found = scorer.to("cpu", precision).compare(moved, torch.from_numpy(target))
        got = torch.autograd.grad(found, moved)[0].numpy()
        assert found.dtype == torch.float32 and found.item() == pytest.approx(value, rel=near)
        assert (got * slope).sum() > along * np.linalg.norm(got) * np.linalg.norm(slope)
