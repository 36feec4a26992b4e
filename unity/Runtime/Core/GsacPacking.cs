using System;

namespace Gsac
{
    /// <summary>The numbers as Gsac.compute and the shader read them: what is uploaded once.</summary>
    public static class GsacPacking
    {
        /// <summary>V x 4: rest place, 1.</summary>
        public static float[] Rest(GsacData data)
        {
            var rows = new float[data.VertexCount * 4];
            for (int v = 0; v < data.VertexCount; v++)
            {
                for (int i = 0; i < 3; i++) rows[v * 4 + i] = data.Vertices[v * 3 + i];
                rows[v * 4 + 3] = 1;
            }
            return rows;
        }

        /// <summary>M x 4, vertex by vertex: how an expression moves it at weight 1, and which. first: V + 1, where a vertex begins.</summary>
        public static float[] Moves(GsacData data, out int[] first)
        {
            int V = data.VertexCount;
            first = new int[V + 1];
            foreach (int v in data.ExpressionVertex) first[v + 1]++;
            for (int v = 0; v < V; v++) first[v + 1] += first[v];
            var next = new int[V];
            Array.Copy(first, next, V);
            var rows = new float[data.ExpressionVertex.Length * 4];
            for (int e = 0; e < data.Expressions.Length; e++)
            {
                for (int m = data.ExpressionStart[e]; m < data.ExpressionStart[e + 1]; m++)
                {
                    int row = next[data.ExpressionVertex[m]]++ * 4;
                    for (int i = 0; i < 3; i++) rows[row + i] = data.ExpressionDelta[m * 3 + i];
                    rows[row + 3] = e;
                }
            }
            return rows;
        }

        /// <summary>(V + 1) x 4: four joints of 8 bits; weights 0, 1; weights 2, 3 of 16 bits; first row of the moves.</summary>
        public static uint[] Skin(GsacData data, int[] first)
        {
            int V = data.VertexCount;
            var rows = new uint[(V + 1) * 4];
            for (int v = 0; v <= V; v++)
            {
                rows[v * 4 + 3] = (uint)first[v];
                for (int k = 0; v < V && k < 4; k++)
                {
                    rows[v * 4] |= (uint)data.SkinIndex[v * 4 + k] << (8 * k);
                    rows[v * 4 + 1 + k / 2] |= (uint)Math.Round(data.SkinWeight[v * 4 + k] * 65535.0) << (16 * (k % 2));
                }
            }
            return rows;
        }

        /// <summary>C x 28: how a joint's turn moves a vertex, three rows of nine numbers, and which joint.</summary>
        public static float[] Pairs(GsacCorrectives correctives)
        {
            var rows = new float[correctives.Joint.Length * 28];
            for (int i = 0; i < correctives.Joint.Length; i++)
            {
                Array.Copy(correctives.Delta, i * 27, rows, i * 28, 27);
                rows[i * 28 + 27] = correctives.Joint[i];
            }
            return rows;
        }

        /// <summary>N x 4: the three vertices of a gaussian's face.</summary>
        public static uint[] Corners(GsacData data, GsacLevel level)
        {
            var rows = new uint[level.Count * 4];
            for (int n = 0; n < level.Count; n++)
            {
                for (int i = 0; i < 3; i++) rows[n * 4 + i] = (uint)data.Faces[level.Face[n] * 3 + i];
            }
            return rows;
        }

        /// <summary>N x 12: mu, 0; unit quaternion x y z w; standard deviations, 0.</summary>
        public static float[] Local(GsacLevel level)
        {
            var rows = new float[level.Count * 12];
            for (int n = 0; n < level.Count; n++)
            {
                double length2 = 0;
                for (int i = 0; i < 4; i++) length2 += (double)level.Quat[n * 4 + i] * level.Quat[n * 4 + i];
                double unit = 1 / Math.Sqrt(length2);
                for (int i = 0; i < 4; i++) rows[n * 12 + 4 + i] = (float)(level.Quat[n * 4 + (i + 1) % 4] * unit);
                for (int i = 0; i < 3; i++)
                {
                    rows[n * 12 + i] = level.Mu[n * 3 + i];
                    rows[n * 12 + 8 + i] = (float)Math.Exp(level.LogScale[n * 3 + i]);
                }
            }
            return rows;
        }

        /// <summary>N x 4: display colour, opacity.</summary>
        public static float[] Colours(GsacLevel level)
        {
            var rows = new float[level.Count * 4];
            for (int n = 0; n < level.Count; n++)
            {
                for (int i = 0; i < 3; i++) rows[n * 4 + i] = level.Rgb[n * 3 + i];
                rows[n * 4 + 3] = level.Opacity[n];
            }
            return rows;
        }

        /// <summary>Two triangles a splat over its corners 4 n .. 4 n + 3.</summary>
        public static uint[] Quads(int count)
        {
            var rows = new uint[count * 6];
            for (int n = 0; n < count; n++)
            {
                uint c = (uint)n * 4;
                rows[n * 6] = c;
                rows[n * 6 + 1] = rows[n * 6 + 4] = c + 1;
                rows[n * 6 + 2] = rows[n * 6 + 3] = c + 2;
                rows[n * 6 + 5] = c + 3;
            }
            return rows;
        }
    }
}
