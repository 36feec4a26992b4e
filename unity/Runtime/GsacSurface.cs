using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>The skinned body as numbers on the processor: for picking and for the self-check, not for frames. The pose's correctives are left out.</summary>
    public sealed class GsacSurface
    {
        readonly GsacData data;
        readonly double[] posed; // V x 3, in the avatar's own space

        public GsacSurface(GsacData data)
        {
            this.data = data;
            posed = new double[data.Vertices.Length];
        }

        /// <summary>V x 3, m, in the avatar's own space: x, y, z of each vertex, as posed last.</summary>
        public double[] Places { get { return posed; } }

        /// <summary>bones: rows of GsacSkeleton.Bones, null for the rest pose with the floor at 0; weights: of the expressions, null for none.</summary>
        public void Pose(Vector4[] bones, float[] weights)
        {
            for (int i = 0; i < posed.Length; i++) posed[i] = data.Vertices[i];
            for (int e = 0; weights != null && e < weights.Length; e++)
            {
                if (weights[e] == 0) continue;
                for (int m = data.ExpressionStart[e]; m < data.ExpressionStart[e + 1]; m++)
                {
                    for (int i = 0; i < 3; i++) posed[data.ExpressionVertex[m] * 3 + i] += weights[e] * data.ExpressionDelta[m * 3 + i];
                }
            }
            for (int v = 0; v < data.VertexCount; v++)
            {
                if (bones == null) posed[v * 3 + 1] -= data.Ground;
                else Skin(bones, v);
            }
        }

        void Skin(Vector4[] bones, int v)
        {
            double x = posed[v * 3], y = posed[v * 3 + 1], z = posed[v * 3 + 2];
            for (int i = 0; i < 3; i++)
            {
                double sum = 0;
                for (int k = v * 4; k < v * 4 + 4; k++)
                {
                    Vector4 row = bones[data.SkinIndex[k] * 3 + i];
                    sum += data.SkinWeight[k] * (row.x * x + row.y * y + row.z * z + row.w);
                }
                posed[v * 3 + i] = sum;
            }
        }

        /// <summary>
        /// The nearest face that a ray from `from` along `ahead` meets, -1 for none: how many times `ahead` away, and the shares of the
        /// face's corners there (Moeller and Trumbore 1997). Faces count from both sides.
        /// </summary>
        public int Meet(Vector3 from, Vector3 ahead, out double away, out Vector3 shares)
        {
            int nearest = -1;
            away = double.MaxValue;
            shares = Vector3.zero;
            for (int f = 0; f < data.Faces.Length; f += 3)
            {
                double t, u, v;
                if (!Meet(f, from, ahead, out t, out u, out v) || t >= away) continue;
                nearest = f / 3;
                away = t;
                shares = new Vector3((float)(1 - u - v), (float)u, (float)v);
            }
            return nearest;
        }

        bool Meet(int f, Vector3 from, Vector3 ahead, out double t, out double u, out double v)
        {
            int a = data.Faces[f] * 3, b = data.Faces[f + 1] * 3, c = data.Faces[f + 2] * 3;
            double px = posed[b] - posed[a], py = posed[b + 1] - posed[a + 1], pz = posed[b + 2] - posed[a + 2];
            double qx = posed[c] - posed[a], qy = posed[c + 1] - posed[a + 1], qz = posed[c + 2] - posed[a + 2];
            double sx = from.x - posed[a], sy = from.y - posed[a + 1], sz = from.z - posed[a + 2];
            double hx = ahead.y * qz - ahead.z * qy, hy = ahead.z * qx - ahead.x * qz, hz = ahead.x * qy - ahead.y * qx;
            double volume = px * hx + py * hy + pz * hz;
            u = (sx * hx + sy * hy + sz * hz) / volume;
            double kx = sy * pz - sz * py, ky = sz * px - sx * pz, kz = sx * py - sy * px;
            v = (ahead.x * kx + ahead.y * ky + ahead.z * kz) / volume;
            t = (qx * kx + qy * ky + qz * kz) / volume;
            // a ray in the face's plane gives no number, which meets nothing
            return u >= 0 && v >= 0 && u + v <= 1 && t >= 0;
        }

        /// <summary>The joint that moves a place on a face most.</summary>
        public int JointAt(int face, Vector3 shares)
        {
            int joint = 0;
            float most = 0;
            for (int i = 0; i < 12; i++)
            {
                int j = data.SkinIndex[data.Faces[face * 3 + i / 4] * 4 + i % 4];
                float sum = Share(face, shares, j);
                if (sum <= most) continue;
                most = sum;
                joint = j;
            }
            return joint;
        }

        float Share(int face, Vector3 shares, int joint)
        {
            float sum = 0;
            for (int i = 0; i < 12; i++)
            {
                int at = data.Faces[face * 3 + i / 4] * 4 + i % 4;
                float share = i < 4 ? shares.x : i < 8 ? shares.y : shares.z;
                if (data.SkinIndex[at] == joint) sum += share * data.SkinWeight[at];
            }
            return sum;
        }

        /// <summary>A corner of a face, 0 to 2, in the avatar's own space.</summary>
        public Vector3 Corner(int face, int corner)
        {
            int at = data.Faces[face * 3 + corner] * 3;
            return new Vector3((float)posed[at], (float)posed[at + 1], (float)posed[at + 2]);
        }
    }
}
