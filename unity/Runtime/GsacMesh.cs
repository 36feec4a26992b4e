using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>
    /// The body under the gaussians as a skinned Unity mesh: for shadows, colliders and own tools. Its blend shapes are the expressions:
    /// their weights move the gaussians too.
    /// </summary>
    public static class GsacMesh
    {
        const string Name = "Body";
        const float Whole = 100;
        static readonly Material[] Bare = new Material[0];

        /// <summary>Shapes by which the mesh follows the jaw's turn where it has no skin of its own: set by the avatar, a whole one is 1 rad.</summary>
        public static readonly string[] JawShapes = { "turned jaw x", "turned jaw y", "turned jaw z" };

        public static Mesh Build(GsacData data)
        {
            var vertices = new Vector3[data.VertexCount];
            var weights = new BoneWeight[data.VertexCount];
            for (int v = 0; v < vertices.Length; v++)
            {
                vertices[v] = new Vector3(data.Vertices[v * 3], data.Vertices[v * 3 + 1], data.Vertices[v * 3 + 2]);
                int[] i = data.SkinIndex;
                float[] w = data.SkinWeight;
                weights[v] = new BoneWeight
                {
                    boneIndex0 = i[v * 4], boneIndex1 = i[v * 4 + 1], boneIndex2 = i[v * 4 + 2], boneIndex3 = i[v * 4 + 3],
                    weight0 = w[v * 4], weight1 = w[v * 4 + 1], weight2 = w[v * 4 + 2], weight3 = w[v * 4 + 3],
                };
            }
            // Unity takes clockwise faces for the front. Only here: the gaussians' binding keeps the order of the file.
            var triangles = new int[data.Faces.Length];
            for (int f = 0; f < triangles.Length; f += 3)
            {
                triangles[f] = data.Faces[f];
                triangles[f + 1] = data.Faces[f + 2];
                triangles[f + 2] = data.Faces[f + 1];
            }
            var binds = new Matrix4x4[data.JointCount];
            for (int j = 0; j < binds.Length; j++) binds[j] = Matrix4x4.Translate(-GsacSkeleton.Place(data, j));
            var mesh = new Mesh { name = Name, indexFormat = vertices.Length > 65535 ? IndexFormat.UInt32 : IndexFormat.UInt16 };
            mesh.vertices = vertices;
            mesh.triangles = triangles;
            mesh.boneWeights = weights;
            mesh.bindposes = binds;
            mesh.RecalculateNormals();
            mesh.RecalculateBounds();
            AddShapes(mesh, data);
            return mesh;
        }

        static void AddShapes(Mesh mesh, GsacData data)
        {
            var moves = new Vector3[data.VertexCount];
            for (int e = 0; e < data.Expressions.Length; e++)
            {
                Array.Clear(moves, 0, moves.Length);
                AddMoves(moves, data, e, 1);
                mesh.AddBlendShapeFrame(data.Expressions[e], Whole, moves, null, null);
            }
            for (int axis = 0; axis < JawShapes.Length; axis++)
            {
                Array.Clear(moves, 0, moves.Length);
                bool any = false;
                for (int e = 0; e < data.Expressions.Length; e++)
                {
                    float weight = data.ExpressionJaw[e * 3 + axis];
                    if (weight == 0) continue;
                    AddMoves(moves, data, e, weight);
                    any = true;
                }
                if (any) mesh.AddBlendShapeFrame(JawShapes[axis], Whole, moves, null, null);
            }
        }

        static void AddMoves(Vector3[] moves, GsacData data, int expression, float weight)
        {
            float[] d = data.ExpressionDelta;
            for (int m = data.ExpressionStart[expression]; m < data.ExpressionStart[expression + 1]; m++)
            {
                moves[data.ExpressionVertex[m]] += new Vector3(d[m * 3], d[m * 3 + 1], d[m * 3 + 2]) * weight;
            }
        }

        /// <summary>The renderer of the body on a child of `root`; null where there is none. What else is called so hangs on other bones.</summary>
        public static SkinnedMeshRenderer Find(Transform root, Transform[] joints)
        {
            for (int i = 0; i < root.childCount; i++)
            {
                if (root.GetChild(i).name != Name) continue;
                var body = root.GetChild(i).GetComponent<SkinnedMeshRenderer>();
                if (body != null && (body.rootBone == null || body.rootBone == joints[0])) return body;
            }
            return null;
        }

        /// <summary>A renderer of the mesh on a child of `root`; it shows nothing before somebody gives it materials, as GsacRenderer does.</summary>
        public static SkinnedMeshRenderer Attach(Mesh mesh, GsacExtent extent, Transform root, Transform[] joints)
        {
            var holder = new GameObject(Name);
            holder.transform.SetParent(root, false);
            var body = holder.AddComponent<SkinnedMeshRenderer>();
            body.shadowCastingMode = ShadowCastingMode.On;
            Wear(body, mesh, extent, joints);
            return body;
        }

        /// <summary>Has the body cast shadows and write depth and motion, or takes that from it; materials that others gave it stay.</summary>
        internal static void Dress(SkinnedMeshRenderer body, bool on)
        {
            Material worn = body.sharedMaterial;
            if (on && worn == null) body.sharedMaterials = GsacCameras.BodyMaterials;
            else if (!on && worn != null && GsacCameras.IsOfBody(worn)) body.sharedMaterials = Bare;
        }

        /// <summary>Gives a renderer the mesh of a person.</summary>
        public static void Wear(SkinnedMeshRenderer body, Mesh mesh, GsacExtent extent, Transform[] joints)
        {
            body.sharedMesh = mesh;
            body.bones = joints;
            body.rootBone = joints[0];
            // Unity takes them about the root bone, not about the mesh's origin
            body.localBounds = new Bounds(Vector3.zero, new Vector3(2, 2, 2) * extent.Reach);
        }
    }
}
