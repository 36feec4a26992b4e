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

        public readonly Camera Camera;
        readonly Material material;
        readonly MaterialPropertyBlock properties = new MaterialPropertyBlock();
        readonly int[] sortKernels = new int[3];
        GraphicsBuffer keys;
        bool found;
        Vector4 depthRow;
        Bounds bounds;

        public GsacView(Camera camera, Material material)
        {
            Camera = camera;
            this.material = material;
        }

        public void Dispose()
        {
            if (keys != null) keys.Dispose();
            keys = null;
        }

        /// <summary>
        /// Nearest and farthest depth that the avatar can have for this camera's centre eye, from its joints alone.
        /// False where all of it lies behind.
        /// </summary>
        public bool Depths(Transform root, Vector4[] bones, GsacModel model, out float low, out float high)
        {
            Transform eye = Camera.transform;
            Vector3 ahead = eye.forward, at = eye.position;
            Matrix4x4 m = root.localToWorldMatrix;
            depthRow = new Vector4(ahead.x * m.m00 + ahead.y * m.m10 + ahead.z * m.m20, ahead.x * m.m01 + ahead.y * m.m11 + ahead.z * m.m21,
                                   ahead.x * m.m02 + ahead.y * m.m12 + ahead.z * m.m22,
                                   ahead.x * (m.m03 - at.x) + ahead.y * (m.m13 - at.y) + ahead.z * (m.m23 - at.z));
            float size = Mathf.Sqrt(depthRow.x * depthRow.x + depthRow.y * depthRow.y + depthRow.z * depthRow.z);
            low = float.MaxValue;
            high = float.MinValue;
            Vector3 least = new Vector3(float.MaxValue, float.MaxValue, float.MaxValue), most = -least;
            for (int j = 0; j < model.Data.JointCount; j++)
            {
                float radius = model.Extent.Radius[j];
                if (radius == 0) continue;
                radius += model.Extent.Pad;
                Vector3 place = GsacSkeleton.Posed(model.Data, bones, j);
                float depth = depthRow.x * place.x + depthRow.y * place.y + depthRow.z * place.z + depthRow.w;
                low = Math.Min(low, depth - radius * size);
                high = Math.Max(high, depth + radius * size);
                var ball = new Vector3(radius, radius, radius);
                least = Vector3.Min(least, place - ball);
                most = Vector3.Max(most, place + ball);
            }
            bounds = WorldBounds(m, least, most);
            // keys are spent on what lies before the eye
            low = Math.Max(low, 0);
            return high > low;
        }

        /// <summary>
        /// Height of the person in the camera's picture, px: of the rest mesh, where the joint nearest to the eye is. Of the
        /// two eyes of a headset the larger.
        /// </summary>
        public float Height(Transform root, Vector4[] bones, GsacModel model)
        {
            Matrix4x4 m = root.localToWorldMatrix;
            if (!Camera.stereoEnabled) return Height(Camera.projectionMatrix, Camera.worldToCameraMatrix * m, bones, model);
            return Math.Max(Height(Camera.StereoscopicEye.Left, m, bones, model), Height(Camera.StereoscopicEye.Right, m, bones, model));
        }

        float Height(Camera.StereoscopicEye eye, Matrix4x4 m, Vector4[] bones, GsacModel model)
        {
            return Height(Camera.GetStereoProjectionMatrix(eye), Camera.GetStereoViewMatrix(eye) * m, bones, model);
        }

        float Height(Matrix4x4 projection, Matrix4x4 toEye, Vector4[] bones, GsacModel model)
        {
            float size = Mathf.Sqrt(toEye.m01 * toEye.m01 + toEye.m11 * toEye.m11 + toEye.m21 * toEye.m21);
            float height = Math.Abs(projection.m11) * Camera.pixelHeight / 2 * size * model.Extent.Stature;
            if (Camera.orthographic) return height;
            float nearest = float.MaxValue;
            for (int j = 0; j < model.Data.JointCount; j++)
            {
                nearest = Math.Min(nearest, toEye.MultiplyPoint3x4(GsacSkeleton.Posed(model.Data, bones, j)).magnitude);
            }
            return height / nearest;
        }

        static Bounds WorldBounds(Matrix4x4 m, Vector3 least, Vector3 most)
        {
            Vector3 half = (most - least) * 0.5f;
            var extents = new Vector3(Math.Abs(m.m00) * half.x + Math.Abs(m.m01) * half.y + Math.Abs(m.m02) * half.z,
                                      Math.Abs(m.m10) * half.x + Math.Abs(m.m11) * half.y + Math.Abs(m.m12) * half.z,
                                      Math.Abs(m.m20) * half.x + Math.Abs(m.m21) * half.y + Math.Abs(m.m22) * half.z);
            return new Bounds(m.MultiplyPoint3x4((most + least) * 0.5f), extents * 2);
        }

        /// <summary>Sorts for this camera and asks Unity to draw.</summary>
        public void Draw(ComputeShader kernels, GraphicsBuffer splats, GsacModel.Level level, GsacModel model, Transform root, float low, float high)
        {
            if (keys == null || keys.count != model.KeyCount) Resize(model.KeyCount);
            Sort(kernels, splats, level, low, high);
            Matrix4x4 m = root.localToWorldMatrix;
            for (int r = 0; r < 3; r++) properties.SetVector(ModelIds[r], m.GetRow(r));
            bool linear = QualitySettings.activeColorSpace == ColorSpace.Linear;
            properties.SetVector(BlendId, new Vector4(model.Data.LowPass, model.Data.AlphaMax, model.Data.AlphaMin, linear ? 1 : 0));
            properties.SetInteger(KeepsEnergyId, model.Data.KeepsEnergy ? 1 : 0);
            properties.SetInteger(IndexBitsId, level.Sort.IndexBits);
            properties.SetBuffer(SplatsId, splats);
            properties.SetBuffer(ColoursId, level.Colours);
            properties.SetBuffer(KeysId, keys);
            var draw = new RenderParams(material)
            {
                camera = Camera, worldBounds = bounds, matProps = properties, layer = root.gameObject.layer,
                shadowCastingMode = ShadowCastingMode.Off, receiveShadows = false,
            };
            Graphics.RenderPrimitivesIndexed(draw, MeshTopology.Triangles, model.Quads, level.Count * 6);
        }

        void Resize(int count)
        {
            Dispose();
            keys = GsacModel.Empty(count, 1);
        }

        void Sort(ComputeShader kernels, GraphicsBuffer splats, GsacModel.Level level, float low, float high)
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
