"""The body's mesh under the gaussians in Unity: its passes compile for every pipeline, and its depth hides no gaussian."""

import re
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.benchmarks.unity import colours
from gsac.benchmarks.unity.gpu import projection

pytestmark = pytest.mark.slow

SIZE = 256
PASSES = {("GsacBody", ""): ["ShadowCaster", "MotionVectors"],
          ("GsacBody", "UniversalPipeline"): ["ShadowCaster", "DepthOnly", "MotionVectors"],
          ("GsacBody", "HDRenderPipeline"): ["ShadowCaster", "MotionVectors"],
          ("GsacBodyDepth", ""): ["Depth"], ("GsacBodyDepth", "UniversalPipeline"): ["Depth"],
          ("GsacBodyDepth", "HDRenderPipeline"): ["TransparentDepthPostpass"]}


@pytest.fixture(scope="module")
def compiled(hlsl, tmp_path_factory):
    """(shader, pipeline) -> pass -> (vertex, fragment) program."""
    out = {}
    for shader in ("GsacBody", "GsacBodyDepth"):
        for part in (hlsl.CORE / f"{shader}.shader").read_text().split("SubShader\n")[1:]:
            pipeline = re.search(r'"RenderPipeline" = "(\w+)"', part)
            programs = out[shader, pipeline[1] if pipeline else ""] = {}
            for one in part.split("        Pass\n")[1:]:
                text = "#define MESH\n" + one.split("HLSLPROGRAM")[1].split("ENDHLSL")[0]
                entries = "Vertex", re.search(r"#pragma fragment (\w+)", one)[1]
                programs[re.search(r'Name "(\w+)"', one)[1]] = hlsl.compile_pass(
                    text, tmp_path_factory.mktemp("body"), Path(__file__).parent / "shims", entries=entries)
    return out


def test_every_pipeline_has_the_bodys_passes_and_all_compile(compiled):
    assert {key: list(programs) for key, programs in compiled.items()} == PASSES


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


@pytest.fixture(scope="module")
def shot(avatar):
    return colours.make_shots(avatar, SIZE, 1, seed=3)[0]


@pytest.fixture(scope="module")
def parameters(shot):
    """Of a pass of the body; the mesh stands in the camera's frame."""
    view, P = np.diag([1.0, -1, -1, 1]), projection(shot.camera)
    moved = np.eye(4)
    moved[0, 3] = -.1
    return {"unity_MatrixV": view, "glstate_matrix_projection": P.T, "unity_ObjectToWorld": np.eye(4), "_HasLastPositionData": 0,
            **dict.fromkeys(("_LightDirection", "_LightPosition"), [0, 0, 0]),
            **dict.fromkeys(("_ScreenParams", "_ScaledScreenParams", "_ScreenSize"), [SIZE, SIZE, 0, 0]),
            **dict.fromkeys(("_WorldSpaceCameraPos", "unity_MotionVectorsParams"), [0, 0, 0, 0]),
            **dict.fromkeys(("_NonJitteredVP", "_NonJitteredViewProjMatrix", "_PreviousVP", "_PrevViewProjMatrix"), (P @ view).T),
            **dict.fromkeys(("_PreviousM", "unity_MatrixPreviousM"), moved.T)}


@pytest.fixture(scope="module")
def painted(gpu, shot, avatar, parameters):
    """Draws the mesh by a pass: picture (H, W, 4), depth texture."""
    def paint(vertex, fragment):
        wgpu, device = gpu.wgpu, gpu.device
        stages = wgpu.ShaderStage
        layout = gpu.layout({stages.VERTEX: vertex, stages.FRAGMENT: fragment})
        forms = ["float32x4", "float32x3", "float32x3"]
        rows = [np.c_[shot.vertices, np.ones(len(shot.vertices))], shot.vertices * 0, shot.vertices]
        buffers = [device.create_buffer_with_data(data=row.astype(np.float32), usage=wgpu.BufferUsage.VERTEX) for row in rows]
        pipeline = device.create_render_pipeline(
            layout=device.create_pipeline_layout(bind_group_layouts=[layout]),
            vertex={"module": device.create_shader_module(code=vertex.code), "entry_point": vertex.entry, "buffers": [
                {"array_stride": 4 * row.shape[1], "attributes": [{"format": form, "offset": 0, "shader_location": i}]}
                for i, (row, form) in enumerate(zip(rows, forms, strict=True))]},
            fragment={"module": device.create_shader_module(code=fragment.code), "entry_point": fragment.entry,
                      "targets": [{"format": "rgba16float"}]},
            primitive={"topology": "triangle-list"},
            depth_stencil={"format": "depth32float", "depth_write_enabled": True, "depth_compare": "less-equal"})
        target, depth = gpu.texture(SIZE, SIZE, "rgba16float"), gpu.texture(SIZE, SIZE, "depth32float")
        index = device.create_buffer_with_data(data=avatar.faces.astype(np.uint32), usage=wgpu.BufferUsage.INDEX)
        encoder, clear = device.create_command_encoder(), {"load_op": "clear", "store_op": "store"}
        work = encoder.begin_render_pass(
            color_attachments=[{"view": target.create_view(), "clear_value": (0, 0, 0, 0), **clear}],
            depth_stencil_attachment={"view": depth.create_view(), "depth_clear_value": 1,
                                      **{f"depth_{what}": how for what, how in clear.items()}})
        work.set_pipeline(pipeline)
        work.set_bind_group(0, gpu.group(layout, [vertex, fragment], vertex.uniform(parameters)))
        for i, buffer in enumerate(buffers):
            work.set_vertex_buffer(i, buffer)
        work.set_index_buffer(index, "uint32")
        work.draw_indexed(avatar.faces.size)
        work.end()
        device.queue.submit([encoder.finish()])
        raw = device.queue.read_texture({"texture": target}, {"bytes_per_row": SIZE * 8, "rows_per_image": SIZE}, (SIZE, SIZE, 1))
        return np.frombuffer(raw, np.float16).reshape(SIZE, SIZE, 4).astype(float), depth
    return paint


@pytest.fixture(scope="module")
def stage(gpu, avatar, shot):
    programs = colours.compile_programs("", Path(__file__).parent / "shims")
    stage = colours.Stage(gpu, programs, avatar, SIZE)
    stage.put(shot, avatar.gaussians)
    stage.draw_own(shot)
    return stage


@pytest.mark.parametrize("way", ["direct", "own"])
def test_the_bodys_depth_cuts_no_gaussian_off_and_its_surface_would(compiled, painted, stage, shot, avatar, way):
    _, behind = painted(*compiled["GsacBodyDepth", ""]["Depth"])
    _, surface = painted(*compiled["GsacBody", ""]["ShadowCaster"])
    draw = stage.draw_direct if way == "direct" else lambda shot, background: stage.lay(shot, background, known=False)
    free = draw(shot, .5)
    person = colours.trained_picture(shot, avatar.faces, avatar.gaussians)[1] > colours.EDGE
    painting = stage.direct if way == "direct" else stage.laid
    found = {}
    for name, depth in (("behind", behind), ("surface", surface)):
        painting.keep_depth(depth)
        found[name] = colours.decibels(draw(shot, .5), free, person)
        painting.keep_depth(None)
    print(f"{way}: {found}")
    assert found["behind"] > 40 and found["behind"] > found["surface"] + 10


@pytest.mark.parametrize("pipeline", ["", "UniversalPipeline", "HDRenderPipeline"])
def test_the_motion_is_the_way_on_the_screen_since_the_frame_before(compiled, painted, shot, pipeline):
    picture, _ = painted(*compiled["GsacBody", pipeline]["MotionVectors"])
    there = picture[..., 0] > 0
    assert there.mean() > .05
    away = np.median(shot.vertices[:, 2])
    way = .1 * shot.camera.focal[0] / away / SIZE  # of a tenth of a metre to the right
    assert abs(np.median(picture[there][:, 0]) / way - 1) < .1 and abs(picture[..., 1]).max() < 1e-3


def test_a_person_wears_the_passes_by_default_and_what_others_gave_her_stays(play, files):
    lines = dict(line.split(": ") for line in play("dressed", files / "figure.gsac").splitlines())
    assert lines["loaded"].split()[:4] == ["2", "True", "On", "True"]
    assert lines["switched off"].split()[0] == lines["faded away"].split()[0] == "0"
    assert lines["half there"].split()[:2] == ["2", "True"] and lines["renderer off"] == "True"
    assert lines["own material"].split()[0] == lines["own material, switched off"].split()[0] == "1"
