using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>What one camera sees of one avatar: its own sorted order, its own draw, both eyes of a headset included.</summary>
    public sealed class GsacView : IDisposable
    {
        const float Slack = 0.9f;
        const float UsualLens = 1.7320508f; // m11 of a projection that sees 60 degrees

        public readonly Camera Camera;
        public readonly GsacRenderer Renderer;
        readonly GsacSorted sorted = new GsacSorted();
        readonly GsacEyes eyes = new GsacEyes();
        readonly Matrix4x4[] toEye = new Matrix4x4[GsacEyes.Most]; // the avatar's space to each eye's
        readonly ComputeShader kernels;
        int drawn; // level of before

        public GsacModel Model { get; private set; }
        public GsacFinish Finish { get; private set; }

        /// <summary>Of the splats, to the world.</summary>
        public Matrix4x4 Space { get; private set; }

        /// <summary>Depth of a point of the world before the camera: dot(xyz, point) + w.</summary>
        public Vector4 WorldRow { get; private set; }

        /// <summary>Depths that the avatar can have.</summary>
        public GsacDepths Depths { get { return depths; } }
        GsacDepths depths;

        /// <summary>In the world.</summary>
        public Bounds Bounds { get; private set; }

        /// <summary>m from an eye to a joint.</summary>
        public float Nearest { get; private set; }

        public int LevelNumber { get; private set; }
        public GsacModel.Level Level { get { return Model.Levels[LevelNumber]; } }
        public bool CanBeCoarser { get { return LevelNumber + 1 < Model.Levels.Length; } }

        /// <summary>The gaussians of the level, bound; and of which pose, other than 0.</summary>
        public GraphicsBuffer Splats { get; internal set; }
        public int Shape { get; internal set; }

        public GsacView(Camera camera, GsacRenderer renderer)
        {
            Camera = camera;
            Renderer = renderer;
            kernels = Resources.Load<ComputeShader>("Gsac/Gsac");
        }

        public void Dispose()
        {
            sorted.Dispose();
        }

        /// <summary>
        /// Takes where the camera is and how far the avatar can reach there, from its joints alone. False where no eye sees any of it.
        /// </summary>
        public bool Look(Transform root, Vector4[] bones, GsacModel model)
        {
            Model = model;
            Matrix4x4 m = Space = root.localToWorldMatrix;
            eyes.Take(Camera);
            WorldRow = new Vector4(0, 0, 0, 0);
            for (int e = 0; e < eyes.Count; e++)
            {
                WorldRow -= eyes.Views[e].GetRow(2) * (1f / eyes.Count); // of two eyes the middle
                toEye[e] = eyes.Views[e] * m;
            }
            Vector4 w = WorldRow;
            depths.Row = new Vector4(w.x * m.m00 + w.y * m.m10 + w.z * m.m20, w.x * m.m01 + w.y * m.m11 + w.z * m.m21,
                                     w.x * m.m02 + w.y * m.m12 + w.z * m.m22, w.x * m.m03 + w.y * m.m13 + w.z * m.m23 + w.w);
            Measure(bones, m);
            if (!(depths.High > depths.Low)) return false;
            for (int e = 0; e < eyes.Count; e++)
            {
                if (Sees(eyes.Lenses[e] * toEye[e], bones)) return true;
            }
            return false;
        }

        /// <summary>Fills Depths, Nearest and Bounds.</summary>
        void Measure(Vector4[] bones, Matrix4x4 m)
        {
            Vector4 row = depths.Row;
            float size = Mathf.Sqrt(row.x * row.x + row.y * row.y + row.z * row.z);
            float nearest = float.MaxValue;
            depths.Low = float.MaxValue;
            depths.High = float.MinValue;
            Vector3 least = new Vector3(float.MaxValue, float.MaxValue, float.MaxValue), most = -least;
            for (int j = 0; j < Model.Data.JointCount; j++)
            {
                Vector3 place = GsacSkeleton.Posed(Model.Data, bones, j);
                for (int e = 0; e < eyes.Count; e++) nearest = Math.Min(nearest, toEye[e].MultiplyPoint3x4(place).magnitude);
                float radius = Model.Extent.Radius[j];
                if (radius == 0) continue;
                radius += Model.Extent.Pad;
                float depth = row.x * place.x + row.y * place.y + row.z * place.z + row.w;
                depths.Low = Math.Min(depths.Low, depth - radius * size);
                depths.High = Math.Max(depths.High, depth + radius * size);
                var ball = new Vector3(radius, radius, radius);
                least = Vector3.Min(least, place - ball);
                most = Vector3.Max(most, place + ball);
            }
            Nearest = nearest;
            Bounds = WorldBounds(m, least, most);
            // keys are spent on what lies before the eye
            if (!IsFlat(eyes.Lenses[0])) depths.Low = Math.Max(depths.Low, 0);
        }

        static bool IsFlat(Matrix4x4 projection)
        {
            return projection.m33 > 0.5f;
        }

        /// <summary>Whether a ball about a joint reaches into the frustum's each plane. toClip: from the avatar's space.</summary>
        bool Sees(Matrix4x4 toClip, Vector4[] bones)
        {
            Vector4 w = toClip.GetRow(3);
            for (int side = 0; side < 6; side++)
            {
                Vector4 row = toClip.GetRow(side / 2);
                float sign = side % 2 == 0 ? 1 : -1;
                if (!Reaches(new Vector4(w.x + sign * row.x, w.y + sign * row.y, w.z + sign * row.z, w.w + sign * row.w), bones)) return false;
            }
            return true;
        }

        /// <summary>Whether some of the avatar lies before a plane.</summary>
        bool Reaches(Vector4 plane, Vector4[] bones)
        {
            float size = Mathf.Sqrt(plane.x * plane.x + plane.y * plane.y + plane.z * plane.z);
            for (int j = 0; j < Model.Data.JointCount; j++)
            {
                float radius = Model.Extent.Radius[j];
                if (radius == 0) continue;
                Vector3 place = GsacSkeleton.Posed(Model.Data, bones, j);
                // what is not a number is seen
                if (!(plane.x * place.x + plane.y * place.y + plane.z * place.z + plane.w < -(radius + Model.Extent.Pad) * size)) return true;
            }
            return false;
        }

        /// <summary>
        /// Takes the level of detail by the person's height in this camera's picture; the one of before while that is about where they change.
        /// finestWithin: m, for files that say no heights.
        /// </summary>
        public void Choose(float finestWithin, GsacFinish finish)
        {
            Finish = finish;
            LevelNumber = drawn = Wanted(finestWithin);
        }

        int Wanted(float finestWithin)
        {
            if (Model.Data.HasHeights)
            {
                float height = Height();
                return Math.Min(Math.Max(drawn, Model.Data.LevelAt(height / Slack)), Model.Data.LevelAt(height));
            }
            float distance = Distance();
            int most = Model.Levels.Length - 1;
            return Math.Min(Math.Max(drawn, LevelAt(distance * Slack, finestWithin, most)), LevelAt(distance, finestWithin, most));
        }

        /// <summary>Takes the next coarser level this time.</summary>
        public void Coarsen()
        {
            LevelNumber++;
        }

        static int LevelAt(float distance, float finestWithin, int most)
        {
            int level = 0;
            for (float within = finestWithin; level < most && distance > within; within *= 2) level++;
            return level;
        }

        /// <summary>
        /// Height of the person in the camera's picture, px: of the rest mesh, where the joint nearest to the eye is. Of the
        /// two eyes of a headset the larger.
        /// </summary>
        float Height()
        {
            float largest = 0;
            for (int e = 0; e < eyes.Count; e++)
            {
                Matrix4x4 m = toEye[e];
                float size = Mathf.Sqrt(m.m01 * m.m01 + m.m11 * m.m11 + m.m21 * m.m21);
                float height = Math.Abs(eyes.Lenses[e].m11) * eyes.Height / 2 * size * Model.Extent.Stature;
                largest = Math.Max(largest, IsFlat(eyes.Lenses[e]) ? height : height / Nearest);
            }
            return largest;
        }

        /// <summary>m: from where a lens of 60 degrees would show the person as large. Of the two eyes of a headset the nearer.</summary>
        float Distance()
        {
            float least = float.MaxValue;
            for (int e = 0; e < eyes.Count; e++)
            {
                float away = IsFlat(eyes.Lenses[e]) ? 1 : toEye[e].MultiplyPoint3x4(Vector3.zero).magnitude;
                least = Math.Min(least, away * UsualLens / Math.Abs(eyes.Lenses[e].m11));
            }
            return least;
        }

        static Bounds WorldBounds(Matrix4x4 m, Vector3 least, Vector3 most)
        {
            Vector3 half = (most - least) * 0.5f;
            var extents = new Vector3(Math.Abs(m.m00) * half.x + Math.Abs(m.m01) * half.y + Math.Abs(m.m02) * half.z,
                                      Math.Abs(m.m10) * half.x + Math.Abs(m.m11) * half.y + Math.Abs(m.m12) * half.z,
                                      Math.Abs(m.m20) * half.x + Math.Abs(m.m21) * half.y + Math.Abs(m.m22) * half.z);
            return new Bounds(m.MultiplyPoint3x4((most + least) * 0.5f), extents * 2);
        }

        /// <summary>Sorts for this camera where that is not done, and asks Unity to draw the avatar by itself.</summary>
        public void Draw()
        {
            sorted.Sort(kernels, Splats, Level.Count, Level.Sort, Model.KeyCount, depths, Shape, LevelNumber);
            sorted.Draw(Camera, Finish, Model.Data, Space, Splats, Level.Colours, Model.Quads, Level.Count, Level.Sort, Bounds);
        }
    }
}
