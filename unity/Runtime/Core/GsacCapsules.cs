using System;
using System.Collections.Generic;

namespace Gsac
{
    /// <summary>A capsule about the part of the body that one joint moves most; at rest, in the avatar's own axes.</summary>
    public sealed class GsacCapsule
    {
        public int Joint;
        public double[] Centre; // m
        public double[] Along;  // unit length
        public double Half;     // m from the centre to where the round ends begin
        public double Radius;   // m
    }

    /// <summary>Capsules for colliders, fitted to the mesh at rest.</summary>
    public static class GsacCapsules
    {
        const int Fewest = 8;       // vertices of a part: fewer have no shape
        const double Within = 0.9;  // share of a part's vertices that lie no farther from its axis than the radius
        const int Iterations = 50;  // for the longest axis

        /// <summary>One for each joint that moves some vertices most.</summary>
        public static List<GsacCapsule> Fit(GsacData data)
        {
            var parts = new List<int>[data.JointCount];
            for (int j = 0; j < parts.Length; j++) parts[j] = new List<int>();
            for (int v = 0; v < data.VertexCount; v++) parts[Strongest(data, v)].Add(v);
            var capsules = new List<GsacCapsule>();
            for (int j = 0; j < parts.Length; j++)
            {
                if (parts[j].Count >= Fewest) capsules.Add(Fit(data, j, parts[j]));
            }
            return capsules;
        }

        static int Strongest(GsacData data, int vertex)
        {
            int most = vertex * 4;
            for (int k = most + 1; k < vertex * 4 + 4; k++)
            {
                if (data.SkinWeight[k] > data.SkinWeight[most]) most = k;
            }
            return data.SkinIndex[most];
        }

        static GsacCapsule Fit(GsacData data, int joint, List<int> part)
        {
            var centre = new double[3];
            foreach (int v in part)
            {
                for (int i = 0; i < 3; i++) centre[i] += data.Vertices[v * 3 + i] / (double)part.Count;
            }
            double[] along = Longest(data, part, centre);
            double low = double.MaxValue, high = double.MinValue;
            var beside = new double[part.Count];
            for (int n = 0; n < beside.Length; n++)
            {
                double t = 0, length2 = 0;
                for (int i = 0; i < 3; i++)
                {
                    double off = data.Vertices[part[n] * 3 + i] - centre[i];
                    t += off * along[i];
                    length2 += off * off;
                }
                low = Math.Min(low, t);
                high = Math.Max(high, t);
                beside[n] = Math.Sqrt(Math.Max(0, length2 - t * t));
            }
            Array.Sort(beside);
            double radius = beside[(int)(Within * (beside.Length - 1))];
            for (int i = 0; i < 3; i++) centre[i] += along[i] * (low + high) / 2;
            return new GsacCapsule { Joint = joint, Centre = centre, Along = along, Radius = radius, Half = Math.Max(0, (high - low) / 2 - radius) };
        }

        /// <summary>The direction in which the part reaches farthest: of its covariance's largest eigenvalue, by power iteration.</summary>
        static double[] Longest(GsacData data, List<int> part, double[] centre)
        {
            var covariance = new double[9];
            foreach (int v in part)
            {
                for (int i = 0; i < 9; i++) covariance[i] += (data.Vertices[v * 3 + i / 3] - centre[i / 3]) * (data.Vertices[v * 3 + i % 3] - centre[i % 3]);
            }
            var along = new double[] { 0.48, 0.64, 0.6 };
            for (int n = 0; n < Iterations; n++)
            {
                var next = new double[3];
                for (int i = 0; i < 9; i++) next[i / 3] += covariance[i] * along[i % 3];
                double length = Math.Sqrt(next[0] * next[0] + next[1] * next[1] + next[2] * next[2]);
                if (length == 0) break; // all in one place
                for (int i = 0; i < 3; i++) along[i] = next[i] / length;
            }
            return along;
        }
    }
}
