using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// The picture that an avatar must give: docs/gsac-format.md, "From file to picture", done plainly on the processor. For
    /// thumbnails, and for the self-check to compare Unity's pictures with.
    /// </summary>
    public sealed class GsacPainter
    {
        const double Near = 0.01; // m
        const double Wide = 1.3;
        const double Darkest = 0.25, Brightest = 2.5;

        readonly GsacData data;
        readonly GsacLevel level;
        readonly double[] posed; // V x 3, in the avatar's own space
        readonly double[] depths;
        readonly int[] order;
        readonly double[] splats; // N x 9: centre x, y; inverse covariance xx, xy, yy; colour; opacity

        GsacPainter(GsacData data, Vector4[] bones, float[] weights)
        {
            this.data = data;
            level = data.Levels[0];
            var surface = new GsacSurface(data);
            surface.Pose(bones, weights);
            posed = surface.Places;
            depths = new double[level.Count];
            order = new int[level.Count];
            splats = new double[level.Count * 9];
        }

        /// <summary>
        /// Width x height x 4, the top row first: display colours times alpha, alpha. data: mirrored; bones: rows of
        /// GsacSkeleton.Bones, null for the rest pose; weights: of the expressions, null for none; toEye: avatar's space to eye, -z ahead;
        /// projection: Unity's, of a camera; correctives of the pose are left out.
        /// </summary>
        public static float[] Paint(GsacData data, Vector4[] bones, float[] weights, Matrix4x4 toEye, Matrix4x4 projection, int width, int height)
        {
            return new GsacPainter(data, bones, weights).Paint(toEye, projection, width, height);
        }

        float[] Paint(Matrix4x4 toEye, Matrix4x4 projection, int width, int height)
        {
            for (int n = 0; n < level.Count; n++)
            {
                order[n] = n;
                depths[n] = Project(n, toEye, projection, width, height);
            }
            Array.Sort(depths, order);
            var picture = new float[width * height * 4];
            for (int i = order.Length - 1; i >= 0; i--)
            {
                if (depths[i] > Near) Lay(order[i] * 9, picture, width, height);
            }
            return picture;
        }

        /// <summary>Fills a row of `splats`; the depth, m, or 0 where it is not drawn.</summary>
        double Project(int n, Matrix4x4 toEye, Matrix4x4 projection, int width, int height)
        {
            double[] centre, r;
            double k = Frame(level.Face[n] * 3, out centre, out r);
            if (k == 0) return 0;
            var mean = new double[3];
            for (int i = 0; i < 3; i++)
            {
                mean[i] = centre[i];
                for (int c = 0; c < 3; c++) mean[i] += k * r[i * 3 + c] * level.Mu[n * 3 + c];
            }
            var eye = new double[3];
            var view = new double[9];
            for (int i = 0; i < 3; i++)
            {
                Vector4 row = toEye.GetRow(i);
                double sign = i == 2 ? -1 : 1;
                view[i * 3] = sign * row.x;
                view[i * 3 + 1] = sign * row.y;
                view[i * 3 + 2] = sign * row.z;
                eye[i] = sign * (row.x * mean[0] + row.y * mean[1] + row.z * mean[2] + row.w);
            }
            if (!(eye[2] > Near)) return 0;
            bool flat = projection.m33 != 0;
            double away = flat ? 1 : eye[2];
            var across = new double[6]; // first order of the picture's x and y, px a metre
            for (int axis = 0; axis < 2; axis++)
            {
                double lens = axis == 0 ? projection.m00 : projection.m11, shift = axis == 0 ? projection.m02 : projection.m12;
                double pixels = lens * (axis == 0 ? width : height) / 2, t = eye[axis] / away;
                double half = Wide / Math.Abs(lens), bent = Math.Min(Math.Max(t, shift / lens - half), shift / lens + half);
                for (int c = 0; c < 3; c++) across[axis * 3 + c] = pixels / away * (view[axis * 3 + c] - (flat ? 0 : bent * view[6 + c]));
                double moved = flat ? (axis == 0 ? projection.m03 : projection.m13) : -shift;
                splats[n * 9 + axis] = axis == 0 ? width / 2.0 + pixels * t + moved * width / 2 : height / 2.0 - pixels * t - moved * height / 2;
            }
            Spread(n, k, r, across);
            Colour(n, r);
            return eye[2];
        }

        /// <summary>The frame's size k, its centre and, as rows, R.</summary>
        double Frame(int f, out double[] centre, out double[] r)
        {
            int a = data.Faces[f] * 3, b = data.Faces[f + 1] * 3, c = data.Faces[f + 2] * 3;
            double[] p = Between(b, c), q = Between(b, a), side = Between(a, c), normal = Cross(p, q);
            centre = new double[3];
            for (int i = 0; i < 3; i++) centre[i] = (posed[a + i] + posed[b + i] + posed[c + i]) / 3;
            double area2 = Length(normal), along = Length(p), across = Length(side);
            r = new double[] { 1, 0, 0, 0, 1, 0, 0, 0, 1 };
            if (area2 <= 1e-6 * (along * along + Length(q) * Length(q))) return 0;
            for (int i = 0; i < 3; i++)
            {
                p[i] /= along;
                normal[i] /= area2;
            }
            double[] third = Cross(p, normal);
            for (int i = 0; i < 3; i++)
            {
                r[i * 3] = p[i];
                r[i * 3 + 1] = normal[i];
                r[i * 3 + 2] = third[i];
            }
            return 10 * (area2 / across + across);
        }

        double[] Between(int from, int to)
        {
            return new[] { posed[to] - posed[from], posed[to + 1] - posed[from + 1], posed[to + 2] - posed[from + 2] };
        }

        static double[] Cross(double[] a, double[] b)
        {
            return new[] { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
        }

        static double Length(double[] a)
        {
            return Math.Sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
        }

        /// <summary>The inverse of the picture's covariance, and what the low-pass leaves of the opacity.</summary>
        void Spread(int n, double k, double[] r, double[] across)
        {
            double w = level.Quat[n * 4], x = level.Quat[n * 4 + 1], y = level.Quat[n * 4 + 2], z = level.Quat[n * 4 + 3];
            double unit = 1 / Math.Sqrt(w * w + x * x + y * y + z * z);
            w *= unit;
            x *= unit;
            y *= unit;
            z *= unit;
            double[] turn =
            {
                1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
            };
            double xx = 0, xy = 0, yy = 0;
            for (int axis = 0; axis < 3; axis++)
            {
                double size = k * Math.Exp(level.LogScale[n * 3 + axis]), u = 0, v = 0;
                for (int i = 0; i < 3; i++)
                {
                    double part = 0;
                    for (int c = 0; c < 3; c++) part += r[i * 3 + c] * turn[c * 3 + axis];
                    u += across[i] * part * size;
                    v += across[3 + i] * part * size;
                }
                xx += u * u;
                xy += u * v;
                yy += v * v;
            }
            double bare = Math.Max(xx * yy - xy * xy, 0);
            xx += data.LowPass;
            yy += data.LowPass;
            double determinant = xx * yy - xy * xy;
            splats[n * 9 + 2] = yy / determinant;
            splats[n * 9 + 3] = xy / determinant; // of y downwards, where the covariance's own has the other sign
            splats[n * 9 + 4] = xx / determinant;
            splats[n * 9 + 8] = level.Opacity[n] * (data.KeepsEnergy ? Math.Sqrt(bare / determinant) : 1);
        }

        void Colour(int n, double[] r)
        {
            for (int c = 0; c < 3; c++)
            {
                double lit = 1;
                if (data.Light != null)
                {
                    lit = data.Light[c] + r[1] * data.Light[3 + c] + r[4] * data.Light[6 + c] + Math.Abs(r[7]) * data.Light[9 + c];
                    lit = Math.Min(Math.Max(lit, Darkest), Brightest);
                }
                splats[n * 9 + 5 + c] = level.Rgb[n * 3 + c] * lit;
            }
        }

        /// <summary>Lays a splat over what is there.</summary>
        void Lay(int s, float[] picture, int width, int height)
        {
            double opacity = splats[s + 8];
            if (opacity < data.AlphaMin) return;
            double xx = splats[s + 2], xy = splats[s + 3], yy = splats[s + 4], area = xx * yy - xy * xy, reach2 = 2 * Math.Log(opacity / data.AlphaMin);
            double wide = Math.Sqrt(reach2 * yy / area), high = Math.Sqrt(reach2 * xx / area);
            int left = (int)Math.Max(0, splats[s] - wide - 0.5), right = (int)Math.Min(width - 1, splats[s] + wide + 0.5);
            int top = (int)Math.Max(0, splats[s + 1] - high - 0.5), bottom = (int)Math.Min(height - 1, splats[s + 1] + high + 0.5);
            for (int j = top; j <= bottom; j++)
            {
                for (int i = left; i <= right; i++)
                {
                    double x = i + 0.5 - splats[s], y = j + 0.5 - splats[s + 1];
                    double alpha = Math.Min(data.AlphaMax, opacity * Math.Exp(-0.5 * (xx * x * x + 2 * xy * x * y + yy * y * y)));
                    if (alpha < data.AlphaMin) continue;
                    int at = (j * width + i) * 4;
                    for (int c = 0; c < 3; c++) picture[at + c] = (float)(splats[s + 5 + c] * alpha + picture[at + c] * (1 - alpha));
                    picture[at + 3] = (float)(alpha + picture[at + 3] * (1 - alpha));
                }
            }
        }
    }
}
