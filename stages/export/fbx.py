"""`avatar.fbx`, for tools that read no glTF: skinned, textured mesh, 55 joints, expressions, animations.

Metres, y up, facing +z, feet at y = 0; joints rest without rotation, so a joint's rotation is SMPL-X's. Expressions are
blend shapes by their ARKit names; each animation is a take. FBX cannot hold gaussians.
"""

from __future__ import annotations

from itertools import count

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.animation import Animation
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.mesh import vertex_normals
from gsac.stages.export.fbx_file import CREATED, FILE_ID, Long, Node, fbx_bytes
from gsac.stages.export.texture import Surface

SECOND = 46186158000
"""Ticks of FBX's time in a second."""
LEAST_WEIGHT = 1e-6
LINEAR_KEYS = 0x00006004
"""Interpolation of a curve's keys."""
PICTURE = "avatar.jpg"
"""Name of the picture inside."""
ROTATION, TRANSLATION = ("Lcl Rotation", "R"), ("Lcl Translation", "T")


def avatar_fbx(avatar: RiggedAvatar, surface: Surface) -> bytes:
    """The file's bytes; the mesh has the body's vertices, with the surface's texture coordinates at the corners of its faces."""
    return _Scene(avatar, surface).bytes()


class _Scene:
    """Objects and connections, filled in order."""

    def __init__(self, avatar: RiggedAvatar, surface: Surface) -> None:
        self.avatar, self.ids = avatar, count(1000)
        ground = np.array([0, avatar.ground, 0], np.float32)
        self.vertices, self.places = avatar.vertices - ground, (avatar.joints - ground).astype(float)
        self.objects, self.connections = Node("Objects"), Node("Connections")
        mesh = self.object("Model", "body", "Mesh")
        mesh.add("Version", 232)
        mesh.properties(("InheritType", "enum", "", "", 1))
        self.connect(mesh, 0)
        self.geometry = self.mesh(surface)
        self.connect(self.geometry, mesh)
        self.connect(self.material(surface.jpeg), mesh)
        self.joints: list[Node] = []
        for j in range(len(avatar.joints)):
            self.joints.append(self.joint(j))
        self.skin()
        self.bind_pose(mesh)
        if avatar.expression_names:
            self.expressions()
        for name, clip in avatar.clips.items():
            self.take(name, clip)

    def object(self, kind: str, name: str, what: str, under: str | None = None) -> Node:
        """Adds an object; under: its class in the file's `name::class`, where that differs from its kind."""
        return self.objects.add(kind, Long(next(self.ids)), f"{name}\0\x01{under or kind}", what)

    def connect(self, child: Node, parent: Node | int, at: str | None = None) -> None:
        above = parent if isinstance(parent, int) else parent.values[0]
        ends = [child.values[0], Long(above)]
        self.connections.add("C", *(["OO", *ends] if at is None else ["OP", *ends, at]))

    def mesh(self, surface: Surface) -> Node:
        faces = self.avatar.faces.astype(np.int32).copy()
        faces[:, 2] = ~faces[:, 2]
        geometry = self.object("Geometry", "body", "Mesh")
        geometry.properties(("Color", "ColorRGB", "Color", "", 0.8, 0.8, 0.8))
        geometry.add("Vertices", self.vertices.astype(np.float64).reshape(-1))
        geometry.add("PolygonVertexIndex", faces.reshape(-1))
        geometry.add("GeometryVersion", 124)
        normals = vertex_normals(self.vertices, self.avatar.faces)
        uv = (surface.uv * (1, -1) + (0, 1)).astype(np.float64)
        layer = Node("Layer", [0])
        layer.add("Version", 100)
        for name, label, field, values, order in (
                ("LayerElementNormal", "", "Normals", normals, self.avatar.faces),
                ("LayerElementUV", "UV", "UV", uv, surface.faces)):
            element = geometry.add(name, 0)
            element.add("Version", 101)
            element.add("Name", label)
            element.add("MappingInformationType", "ByPolygonVertex")
            element.add("ReferenceInformationType", "IndexToDirect")
            element.add(field, values.reshape(-1))
            element.add(f"{field}Index", order.reshape(-1).astype(np.int32))
            entry = layer.add("LayerElement")
            entry.add("Type", name)
            entry.add("TypedIndex", 0)
        element = geometry.add("LayerElementMaterial", 0)
        for name, value in (("Version", 101), ("Name", ""), ("MappingInformationType", "AllSame"),
                            ("ReferenceInformationType", "IndexToDirect"), ("Materials", np.zeros(1, np.int32))):
            element.add(name, value)
        entry = layer.add("LayerElement")
        entry.add("Type", "LayerElementMaterial")
        entry.add("TypedIndex", 0)
        geometry.children.append(layer)
        return geometry

    def material(self, jpeg: bytes) -> Node:
        """Adds a material that shows a picture, which lies in the file."""
        material = self.object("Material", "body", "")
        material.add("Version", 102)
        material.add("ShadingModel", "lambert")
        material.properties(("DiffuseColor", "Color", "", "A", 1.0, 1.0, 1.0))
        texture = self.object("Texture", "body", "")
        for name, value in (("Type", "TextureVideoClip"), ("Version", 202), ("TextureName", "body\0\x01Texture"),
                            ("Media", "body\0\x01Video"), ("FileName", PICTURE), ("RelativeFilename", PICTURE)):
            texture.add(name, value)
        texture.properties(("UVSet", "KString", "", "", "UV"), ("UseMaterial", "bool", "", "", 1))
        video = self.object("Video", "body", "Clip")
        video.add("Type", "Clip")
        video.properties(("Path", "KString", "XRefUrl", "", PICTURE))
        for name, value in (("UseMipMap", 0), ("Filename", PICTURE), ("RelativeFilename", PICTURE), ("Content", jpeg)):
            video.add(name, value)
        self.connect(texture, material, "DiffuseColor")
        self.connect(video, texture)
        return material

    def joint(self, j: int) -> Node:
        """Adds a bone without rotation; its parent must be there."""
        parent = int(self.avatar.parents[j])
        place = self.places[j] - (self.places[parent] if parent >= 0 else 0)
        bone = self.object("Model", self.avatar.joint_names[j], "LimbNode")
        bone.add("Version", 232)
        bone.properties(("InheritType", "enum", "", "", 1), ("Lcl Translation", "Lcl Translation", "", "A", *map(float, place)))
        attribute = self.object("NodeAttribute", self.avatar.joint_names[j], "LimbNode")
        attribute.add("TypeFlags", "Skeleton")
        self.connect(attribute, bone)
        self.connect(bone, self.joints[parent] if parent >= 0 else 0)
        return bone

    def skin(self) -> None:
        skin = self.object("Deformer", "", "Skin")
        skin.add("Version", 101)
        skin.add("Link_DeformAcuracy", 50.0)
        self.connect(skin, self.geometry)
        index, weight = self.avatar.skin_index, self.avatar.skin_weight
        for j, bone in enumerate(self.joints):
            total = np.where(index == j, weight, 0).sum(1)
            moved = np.flatnonzero(total > LEAST_WEIGHT).astype(np.int32)
            cluster = self.object("Deformer", "", "Cluster", "SubDeformer")
            cluster.add("Version", 100)
            cluster.add("UserData", "", "")
            if len(moved):
                cluster.add("Indexes", moved)
                cluster.add("Weights", total[moved].astype(np.float64))
            cluster.add("Transform", _translation(-self.places[j]))
            cluster.add("TransformLink", _translation(self.places[j]))
            self.connect(cluster, skin)
            self.connect(bone, cluster)

    def bind_pose(self, mesh: Node) -> None:
        pose = self.object("Pose", "bind", "BindPose")
        pose.add("Type", "BindPose")
        pose.add("Version", 100)
        pose.add("NbPoseNodes", len(self.joints) + 1)
        for node, place in [(mesh, np.zeros(3)), *zip(self.joints, self.places, strict=True)]:
            entry = pose.add("PoseNode")
            entry.add("Node", node.values[0])
            entry.add("Matrix", _translation(place))

    def expressions(self) -> None:
        shapes = self.object("Deformer", "expressions", "BlendShape")
        shapes.add("Version", 100)
        self.connect(shapes, self.geometry)
        start = self.avatar.expression_start
        for e, name in enumerate(self.avatar.expression_names):
            span = slice(start[e], start[e + 1])
            channel = self.object("Deformer", name, "BlendShapeChannel", "SubDeformer")
            channel.add("Version", 100)
            channel.add("DeformPercent", 0.0)
            channel.add("FullWeights", np.array([100.0]))
            shape = self.object("Geometry", name, "Shape")
            shape.add("Version", 100)
            shape.add("Indexes", self.avatar.expression_vertex[span].astype(np.int32))
            shape.add("Vertices", self.avatar.expression_delta[span].astype(np.float64).reshape(-1))
            shape.add("Normals", np.zeros(3 * (start[e + 1] - start[e])))
            self.connect(channel, shapes)
            self.connect(shape, channel)

    def take(self, name: str, clip: Animation) -> None:
        """Adds an animation; a looping one ends with its first key."""
        closed = [*range(len(clip.rotation)), *([0] if clip.loop else [])]
        times = np.rint(np.arange(len(closed)) / clip.fps * SECOND).astype(np.int64)
        stack = self.object("AnimationStack", name, "", "AnimStack")
        stack.properties(*((f"{span}{end}", "KTime", "Time", "", Long(int(time))) for span in ("Local", "Reference")
                           for end, time in (("Start", 0), ("Stop", times[-1]))))
        layer = self.object("AnimationLayer", name, "", "AnimLayer")
        self.connect(layer, stack)
        for n, joint in enumerate(clip.joints):
            euler = Rotation.from_rotvec(clip.rotation[closed, n]).as_euler("xyz")
            self.curves(layer, self.avatar.joint_names.index(joint), ROTATION, times, np.degrees(np.unwrap(euler, axis=0)))
        root = int(np.flatnonzero(self.avatar.parents < 0)[0])
        self.curves(layer, root, TRANSLATION, times, clip.transl[closed] + self.places[root])

    def curves(self, layer: Node, j: int, track: tuple[str, str], times: np.ndarray, values: np.ndarray) -> None:
        """Adds the curves of one joint. times: (K,) ticks; values: (K, 3) degrees or m."""
        node = self.object("AnimationCurveNode", track[1], "", "AnimCurveNode")
        node.properties(*((f"d|{axis}", "Number", "", "A", float(v)) for axis, v in zip("XYZ", values[0], strict=True)))
        self.connect(node, layer)
        self.connect(node, self.joints[j], track[0])
        for axis, row in zip("XYZ", values.T, strict=True):
            curve = self.object("AnimationCurve", "", "", "AnimCurve")
            for name, value in (("Default", float(row[0])), ("KeyVer", 4008), ("KeyTime", times),
                                ("KeyValueFloat", row.astype(np.float32)), ("KeyAttrFlags", np.array([LINEAR_KEYS], np.int32)),
                                ("KeyAttrDataFloat", np.zeros(4, np.float32)),
                                ("KeyAttrRefCount", np.array([len(times)], np.int32))):
                curve.add(name, value)
            self.connect(curve, node, f"d|{axis}")

    def bytes(self) -> bytes:
        head = Node("FBXHeaderExtension")
        for name, value in (("FBXHeaderVersion", 1003), ("FBXVersion", 7400), ("EncryptionType", 0), ("Creator", "gsac")):
            head.add(name, value)
        settings = Node("GlobalSettings")
        settings.add("Version", 1000)
        settings.properties(*((name, "int", "Integer", "", value) for name, value in (
            ("UpAxis", 1), ("UpAxisSign", 1), ("FrontAxis", 2), ("FrontAxisSign", 1), ("CoordAxis", 0), ("CoordAxisSign", 1))),
            ("UnitScaleFactor", "double", "Number", "", 100.0), ("OriginalUnitScaleFactor", "double", "Number", "", 100.0))
        documents = Node("Documents")
        documents.add("Count", 1)
        document = documents.add("Document", Long(next(self.ids)), "", "Scene")
        document.add("RootNode", Long(0))
        definitions, kinds = Node("Definitions"), [node.name for node in self.objects.children]
        definitions.add("Version", 100)
        definitions.add("Count", len(kinds) + 1)
        for kind in ["GlobalSettings", *dict.fromkeys(kinds)]:
            definitions.add("ObjectType", kind).add("Count", max(kinds.count(kind), 1))
        return fbx_bytes([head, Node("FileId", [FILE_ID]), Node("CreationTime", [CREATED]), Node("Creator", ["gsac"]), settings,
                          documents, Node("References"), definitions, self.objects, self.connections])


def _translation(place: np.ndarray) -> np.ndarray:
    """(16,) float64: a translation, column by column."""
    matrix = np.eye(4)
    matrix[3, :3] = place
    return matrix.reshape(-1)
