using System;

namespace Gsac
{
    /// <summary>
    /// How far an avatar reaches, without reading anything back: a skinned vertex lies in the convex hull of balls about
    /// its joints, however they turn. Radius: J, m; Pad: what gaussians add beyond the mesh.
    /// </summary>
    public sealed class GsacExtent
    {
        const float Sigmas = 3;
        const float Stretch = 1.5f;

        public readonly float[] Radius;
        public readonly float Pad;

        /// <summary>m: what lies farthest from joint 0 in any pose lies within it.</summary>
        public readonly float Reach;

        /// <summary>m: height of the rest mesh.</summary>
        public readonly float Stature;

        public GsacExtent(GsacData data)
        {
            Radius = new float[data.JointCount];
            var moved = new float[data.VertexCount];
            for (int m = 0; m < data.ExpressionVertex.Length; m++) moved[data.ExpressionVertex[m]] += Length(data.ExpressionDelta, m * 3);
            for (int v = 0; data.Correctives != null && v < data.VertexCount; v++) moved[v] += data.Correctives.Reach(v);
            float low = float.MaxValue, high = float.MinValue;
            for (int v = 0; v < data.VertexCount; v++)
            {
                low = Math.Min(low, data.Vertices[v * 3 + 1]);
                high = Math.Max(high, data.Vertices[v * 3 + 1]);
                for (int k = v * 4; k < v * 4 + 4; k++)
                {
                    if (data.SkinWeight[k] <= 0) continue;
                    int j = data.SkinIndex[k];
                    Radius[j] = Math.Max(Radius[j], Distance(data.Vertices, v * 3, data.Joints, j * 3) + moved[v]);
                }
            }
            Stature = high - low;
            var along = new float[data.JointCount];
            for (int j = 0; j < along.Length; j++)
            {
                if (j > 0) along[j] = along[data.Parents[j]] + Distance(data.Joints, j * 3, data.Joints, data.Parents[j] * 3);
                Reach = Math.Max(Reach, along[j] + Radius[j]);
            }
            foreach (GsacLevel level in data.Levels)
            {
                for (int n = 0; n < level.Count; n++)
                {
                    int f = level.Face[n] * 3;
                    float scale = Math.Max(level.LogScale[n * 3], Math.Max(level.LogScale[n * 3 + 1], level.LogScale[n * 3 + 2]));
                    float reach = Length(level.Mu, n * 3) + Sigmas * (float)Math.Exp(scale);
                    Pad = Math.Max(Pad, Stretch * FaceSize(data, f) * reach);
                }
            }
        }

        /// <summary>The k of docs/gsac-format.md at rest.</summary>
        static float FaceSize(GsacData data, int f)
        {
            int a = data.Faces[f] * 3, b = data.Faces[f + 1] * 3, c = data.Faces[f + 2] * 3;
            float x = Distance(data.Vertices, c, data.Vertices, b), y = Distance(data.Vertices, a, data.Vertices, b);
            // the height over a side is at most the shorter of the other two
            return 10 * (Distance(data.Vertices, a, data.Vertices, c) + Math.Min(x, y));
        }

        static float Length(float[] a, int i)
        {
            return (float)Math.Sqrt(a[i] * a[i] + a[i + 1] * a[i + 1] + a[i + 2] * a[i + 2]);
        }

        static float Distance(float[] a, int i, float[] b, int j)
        {
            float x = a[i] - b[j], y = a[i + 1] - b[j + 1], z = a[i + 2] - b[j + 2];
            return (float)Math.Sqrt(x * x + y * y + z * z);
        }
    }
}
