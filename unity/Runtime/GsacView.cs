using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>What one camera sees of one avatar: its own sorted order, its own draw, both eyes of a headset included.</summary>
    public sealed class GsacView : IDisposable
    {
        static readonly int SplatCountId = Shader.PropertyToID("GsacSplatCount");
        static readonly int IndexBitsId = Shader.PropertyToID("GsacIndexBits");
        static readonly int SortStageId = Shader.PropertyToID("GsacSortStage");
        static readonly int SortShiftId = Shader.PropertyToID("GsacSortShift");
        static readonly int SortStridesId = Shader.PropertyToID("GsacSortStrides");
        static readonly int DepthRangeId = Shader.PropertyToID("GsacDepthRange");
        static readonly int DepthRowId = Shader.PropertyToID("GsacDepthRow");
        static readonly int SplatsId = Shader.PropertyToID("GsacSplats");
        static readonly int KeysId = Shader.PropertyToID("GsacKeys");
        static readonly int ColoursId = Shader.PropertyToID("GsacColours");
        static readonly int BlendId = Shader.PropertyToID("GsacBlend");
        static readonly int KeepsEnergyId = Shader.PropertyToID("GsacKeepsEnergy");
        static readonly int[] ModelIds =
        {
            Shader.PropertyToID("GsacModel0"), Shader.PropertyToID("GsacModel1"), Shader.PropertyToID("GsacModel2"),
        };
        static readonly string[] SortNames = { "SortBlocks", "SortAcross", "SortMerge" };
        const float Slack = 0.9f;
        const float UsualLens = 1.7320508f; // m11 of a projection that sees 60 degrees

        public readonly Camera Camera;
        readonly MaterialPropertyBlock properties = new MaterialPropertyBlock();
        readonly int[] sortKernels = new int[3];
        readonly Matrix4x4[] toEye = new Matrix4x4[2], lens = new Matrix4x4[2]; // of each eye: the avatar's space to the eye's, projection
        int eyes;
        float nearest; // m from an eye to a joint
        readonly GsacPicture picture = new GsacPicture();
        GraphicsBuffer keys;
        bool found;
        Vector4 depthRow;
        float low, high; // depths that the avatar can have
        Bounds bounds;
        int drawn; // level
        int sortedShape, sortedLevel;
        Vector4 sortedRow;
        float sortedLow, sortedHigh;

        public GsacView(Camera camera)
        {
            Camera = camera;
        }

        public void Dispose()
        {
            picture.Dispose();
            if (keys != null) keys.Dispose();
            keys = null;
            sortedShape = 0;
        }

        /// <summary>
        /// Takes where the camera is and how far the avatar can reach there, from its joints alone. False where no eye sees any of it.
        /// </summary>
        public bool Look(Transform root, Vector4[] bones, GsacModel model)
        {
            Matrix4x4 m = root.localToWorldMatrix;
            eyes = Camera.stereoEnabled ? 2 : 1;
            for (int e = 0; e < eyes; e++)
            {
                var eye = (Camera.StereoscopicEye)e;
                toEye[e] = (eyes == 2 ? Camera.GetStereoViewMatrix(eye) : Camera.worldToCameraMatrix) * m;
                lens[e] = eyes == 2 ? Camera.GetStereoProjectionMatrix(eye) : Camera.projectionMatrix;
            }
            // of two eyes the middle
            Vector4 one = toEye[0].GetRow(2), other = toEye[eyes - 1].GetRow(2);
            depthRow = new Vector4(-(one.x + other.x) / 2, -(one.y + other.y) / 2, -(one.z + other.z) / 2, -(one.w + other.w) / 2);
            Measure(bones, model, m);
            if (!(high > low)) return false;
            for (int e = 0; e < eyes; e++)
            {
                if (Sees(lens[e] * toEye[e], bones, model)) return true;
            }
            return false;
        }

        /// <summary>Fills low, high, nearest and bounds.</summary>
        void Measure(Vector4[] bones, GsacModel model, Matrix4x4 m)
        {
            float size = Mathf.Sqrt(depthRow.x * depthRow.x + depthRow.y * depthRow.y + depthRow.z * depthRow.z);
            low = nearest = float.MaxValue;
            high = float.MinValue;
            Vector3 least = new Vector3(float.MaxValue, float.MaxValue, float.MaxValue), most = -least;
            for (int j = 0; j < model.Data.JointCount; j++)
            {
                Vector3 place = GsacSkeleton.Posed(model.Data, bones, j);
                for (int e = 0; e < eyes; e++) nearest = Math.Min(nearest, toEye[e].MultiplyPoint3x4(place).magnitude);
                float radius = model.Extent.Radius[j];
                if (radius == 0) continue;
                radius += model.Extent.Pad;
                float depth = depthRow.x * place.x + depthRow.y * place.y + depthRow.z * place.z + depthRow.w;
                low = Math.Min(low, depth - radius * size);
                high = Math.Max(high, depth + radius * size);
                var ball = new Vector3(radius, radius, radius);
                least = Vector3.Min(least, place - ball);
                most = Vector3.Max(most, place + ball);
            }
            bounds = WorldBounds(m, least, most);
            // keys are spent on what lies before the eye
            if (!IsFlat(lens[0])) low = Math.Max(low, 0);
        }

        static bool IsFlat(Matrix4x4 projection)
        {
            return projection.m33 > 0.5f;
        }

        /// <summary>Whether a ball about a joint reaches into the frustum's each plane. toClip: from the avatar's space.</summary>
        static bool Sees(Matrix4x4 toClip, Vector4[] bones, GsacModel model)
        {
            Vector4 w = toClip.GetRow(3);
            for (int side = 0; side < 6; side++)
            {
                Vector4 row = toClip.GetRow(side / 2);
                float sign = side % 2 == 0 ? 1 : -1;
                if (!Reaches(new Vector4(w.x + sign * row.x, w.y + sign * row.y, w.z + sign * row.z, w.w + sign * row.w), bones, model)) return false;
            }
            return true;
        }

        /// <summary>Whether some of the avatar lies before a plane.</summary>
        static bool Reaches(Vector4 plane, Vector4[] bones, GsacModel model)
        {
            float size = Mathf.Sqrt(plane.x * plane.x + plane.y * plane.y + plane.z * plane.z);
            for (int j = 0; j < model.Data.JointCount; j++)
            {
                float radius = model.Extent.Radius[j];
                if (radius == 0) continue;
                Vector3 place = GsacSkeleton.Posed(model.Data, bones, j);
                // what is not a number is seen
                if (!(plane.x * place.x + plane.y * place.y + plane.z * place.z + plane.w < -(radius + model.Extent.Pad) * size)) return true;
            }
            return false;
        }

        /// <summary>
        /// The level of detail by the person's height in this camera's picture; the one of before while that is about where they change.
        /// finestWithin: m, for files that say no heights.
        /// </summary>
        public int Level(GsacModel model, float finestWithin)
        {
            if (model.Data.HasHeights)
            {
                float height = Height(model);
                return drawn = Math.Min(Math.Max(drawn, model.Data.LevelAt(height / Slack)), model.Data.LevelAt(height));
            }
            float distance = Distance();
            int most = model.Levels.Length - 1;
            return drawn = Math.Min(Math.Max(drawn, LevelAt(distance * Slack, finestWithin, most)), LevelAt(distance, finestWithin, most));
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
        float Height(GsacModel model)
        {
            float largest = 0;
            for (int e = 0; e < eyes; e++)
            {
                Matrix4x4 m = toEye[e];
                float size = Mathf.Sqrt(m.m01 * m.m01 + m.m11 * m.m11 + m.m21 * m.m21);
                float height = Math.Abs(lens[e].m11) * Camera.pixelHeight / 2 * size * model.Extent.Stature;
                largest = Math.Max(largest, IsFlat(lens[e]) ? height : height / nearest);
            }
            return largest;
        }

        /// <summary>m: from where a lens of 60 degrees would show the person as large. Of the two eyes of a headset the nearer.</summary>
        float Distance()
        {
            float least = float.MaxValue;
            for (int e = 0; e < eyes; e++)
            {
                float away = IsFlat(lens[e]) ? 1 : toEye[e].MultiplyPoint3x4(Vector3.zero).magnitude;
                least = Math.Min(least, away * UsualLens / Math.Abs(lens[e].m11));
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

        /// <summary>
        /// Sorts for this camera, unless it stands and looks as before at the same, and asks Unity to draw. n: the level's number;
        /// shape: of the splats, other than 0; trained: in linear colours by a picture of its own.
        /// </summary>
        public void Draw(ComputeShader kernels, GraphicsBuffer splats, GsacModel.Level level, int n, GsacModel model, Transform root, int shape,
                         bool trained)
        {
            if (keys == null || keys.count != model.KeyCount) Resize(model.KeyCount);
            if (!IsSorted(n, shape)) Sort(kernels, splats, level);
            Matrix4x4 m = root.localToWorldMatrix;
            for (int r = 0; r < 3; r++) properties.SetVector(ModelIds[r], m.GetRow(r));
            bool linear = QualitySettings.activeColorSpace == ColorSpace.Linear;
            bool own = linear && trained && eyes == 1 && GsacPicture.IsPossible;
            properties.SetVector(BlendId, new Vector4(model.Data.LowPass, model.Data.AlphaMax, model.Data.AlphaMin, linear && !own ? 1 : 0));
            properties.SetInteger(KeepsEnergyId, model.Data.KeepsEnergy ? 1 : 0);
            properties.SetInteger(IndexBitsId, level.Sort.IndexBits);
            properties.SetBuffer(SplatsId, splats);
            properties.SetBuffer(ColoursId, level.Colours);
            properties.SetBuffer(KeysId, keys);
            var draw = new RenderParams(own ? GsacCameras.TrainedMaterial : GsacCameras.Material)
            {
                camera = Camera, worldBounds = bounds, matProps = properties, layer = root.gameObject.layer,
                shadowCastingMode = ShadowCastingMode.Off, receiveShadows = false,
            };
            int indices = level.Count * 6;
            if (own)
            {
                picture.Draw(Camera, bounds, properties, model.Quads, indices);
                indices = 6; // the picture's two triangles
            }
            Graphics.RenderPrimitivesIndexed(draw, MeshTopology.Triangles, model.Quads, indices);
        }

        void Resize(int count)
        {
            Dispose();
            keys = GsacModel.Empty(count, 1);
        }

        /// <summary>Whether the keys are already those of this moment; from here on they are.</summary>
        bool IsSorted(int n, int shape)
        {
            bool same = shape == sortedShape && n == sortedLevel && low == sortedLow && high == sortedHigh && depthRow.x == sortedRow.x
                && depthRow.y == sortedRow.y && depthRow.z == sortedRow.z && depthRow.w == sortedRow.w;
            sortedShape = shape;
            sortedLevel = n;
            sortedLow = low;
            sortedHigh = high;
            sortedRow = depthRow;
            return same;
        }

        void Sort(ComputeShader kernels, GraphicsBuffer splats, GsacModel.Level level)
        {
            if (!found)
            {
                for (int i = 0; i < 3; i++) sortKernels[i] = kernels.FindKernel(SortNames[i]);
                found = true;
            }
            kernels.SetInt(SplatCountId, level.Count);
            kernels.SetInt(IndexBitsId, level.Sort.IndexBits);
            kernels.SetVector(DepthRangeId, new Vector4(low, 1 / (high - low), 0, 0));
            kernels.SetVector(DepthRowId, depthRow);
            kernels.SetBuffer(sortKernels[(int)GsacSortKernel.Blocks], SplatsId, splats);
            GsacSortStep[] steps = level.Sort.Steps;
            for (int i = 0; i < steps.Length; i++)
            {
                int kernel = sortKernels[(int)steps[i].Kernel];
                kernels.SetInt(SortStageId, steps[i].Stage);
                kernels.SetInt(SortShiftId, steps[i].Shift);
                kernels.SetInt(SortStridesId, steps[i].Strides);
                kernels.SetBuffer(kernel, KeysId, keys);
                kernels.Dispatch(kernel, steps[i].Groups, 1, 1);
            }
        }
    }
}
