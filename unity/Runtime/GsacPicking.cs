using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>Rays against one avatar's body as it stands, without physics: skinned on the processor, once for each pose that is asked about.</summary>
    public sealed class GsacPicking
    {
        public readonly GsacModel Model;
        readonly GsacSurface surface;
        readonly Vector4[] bones, now;
        readonly float[] weights;
        bool posed;

        public GsacPicking(GsacModel model)
        {
            Model = model;
            surface = new GsacSurface(model.Data);
            bones = new Vector4[Model.Data.JointCount * 3];
            now = new Vector4[bones.Length];
            weights = new float[Model.Data.Expressions.Length];
        }

        /// <summary>joints, weights: as the avatar stands; farthest: m.</summary>
        public bool Raycast(Transform root, Transform[] joints, float[] weights, Ray ray, float farthest, out GsacHit hit)
        {
            hit = new GsacHit();
            Matrix4x4 toOwn = root.worldToLocalMatrix, toWorld = root.localToWorldMatrix;
            Vector3 from = toOwn.MultiplyPoint3x4(ray.origin);
            Vector3 ahead = toOwn.MultiplyPoint3x4(ray.origin + ray.direction) - from;
            GsacSkeleton.Bones(Model.Data, root, joints, now);
            if (!IsNear(from, ahead)) return false;
            if (!posed | !GsacKept.Keep(now, bones) | !GsacKept.Keep(weights, this.weights)) surface.Pose(bones, this.weights);
            posed = true;
            double away;
            Vector3 shares;
            int face = surface.Meet(from, ahead, out away, out shares);
            if (face < 0 || away > farthest) return false;
            hit.Face = face;
            hit.Shares = shares;
            hit.Joint = Model.Data.JointNames[surface.JointAt(face, shares)];
            hit.Distance = (float)away;
            hit.Position = ray.origin + ray.direction * hit.Distance;
            hit.Normal = Normal(face, toWorld, ray.direction);
            return true;
        }

        /// <summary>Whether the ray meets one of the balls about the joints, in which every vertex lies (GsacExtent).</summary>
        bool IsNear(Vector3 from, Vector3 ahead)
        {
            float length2 = Vector3.Dot(ahead, ahead);
            for (int j = 0; j < Model.Data.JointCount; j++)
            {
                float radius = Model.Extent.Radius[j];
                if (radius == 0) continue;
                Vector3 beside = GsacSkeleton.Posed(Model.Data, now, j) - from;
                Vector3 off = beside - ahead * Math.Max(0, Vector3.Dot(beside, ahead) / length2);
                if (Vector3.Dot(off, off) <= radius * radius) return true;
            }
            return false;
        }

        Vector3 Normal(int face, Matrix4x4 toWorld, Vector3 ahead)
        {
            Vector3 a = toWorld.MultiplyPoint3x4(surface.Corner(face, 0));
            Vector3 p = toWorld.MultiplyPoint3x4(surface.Corner(face, 1)) - a, q = toWorld.MultiplyPoint3x4(surface.Corner(face, 2)) - a;
            var normal = new Vector3(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x);
            float length = normal.magnitude;
            return normal * ((Vector3.Dot(normal, ahead) > 0 ? -1 : 1) / length);
        }
    }
}
