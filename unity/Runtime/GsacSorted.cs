using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>Gaussians sorted for one camera and drawn at once: those of one avatar, or of several who stand among each other.</summary>
    public sealed class GsacSorted : IDisposable
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
        static readonly int TintId = Shader.PropertyToID("GsacTint");
        static readonly int FogId = Shader.PropertyToID("GsacFog");
        static readonly int NumberId = Shader.PropertyToID("GsacNumber");
        static readonly int LatestId = Shader.PropertyToID("GsacLatest");
        static readonly int KeepsEnergyId = Shader.PropertyToID("GsacKeepsEnergy");
        static readonly int[] ModelIds =
        {
            Shader.PropertyToID("GsacModel0"), Shader.PropertyToID("GsacModel1"), Shader.PropertyToID("GsacModel2"),
        };
        static readonly string[] SortNames = { "SortBlocks", "SortAcross", "SortMerge" };

        readonly MaterialPropertyBlock properties = new MaterialPropertyBlock();
        readonly int[] sortKernels = new int[3];
        readonly GsacPicture picture = new GsacPicture();
        bool found;
        readonly int[] number = new int[1]; // of the frame's draws
        int frame = -1;
        GraphicsBuffer keys, latest;
        int sortedShape, sortedPart;
        GsacDepths sorted;

        public void Dispose()
        {
            picture.Dispose();
            if (keys == null) return;
            keys.Dispose();
            latest.Dispose();
            keys = null;
            sortedShape = 0;
        }

        /// <summary>
        /// Sorts unless that is done. shape, part: which splats these are, shape other than 0; most: keys that are ever sorted here.
        /// </summary>
        public void Sort(ComputeShader kernels, GraphicsBuffer splats, int count, GsacSort sort, int most, GsacDepths depths, int shape, int part)
        {
            if (keys == null || keys.count != most) Resize(most);
            bool same = shape == sortedShape && part == sortedPart && depths.IsLike(sorted);
            sortedShape = shape;
            sortedPart = part;
            sorted = depths;
            if (!same) Dispatch(kernels, splats, count, sort);
        }

        void Resize(int most)
        {
            Dispose();
            keys = GsacModel.Empty(most, 1);
            latest = GsacModel.Empty(1, 1);
            latest.SetData(number);
        }

        void Dispatch(ComputeShader kernels, GraphicsBuffer splats, int count, GsacSort sort)
        {
            if (!found)
            {
                for (int i = 0; i < 3; i++) sortKernels[i] = kernels.FindKernel(SortNames[i]);
                found = true;
            }
            kernels.SetInt(SplatCountId, count);
            kernels.SetInt(IndexBitsId, sort.IndexBits);
            kernels.SetVector(DepthRangeId, new Vector4(sorted.Low, 1 / (sorted.High - sorted.Low), 0, 0));
            kernels.SetVector(DepthRowId, sorted.Row);
            kernels.SetBuffer(sortKernels[(int)GsacSortKernel.Blocks], SplatsId, splats);
            GsacSortStep[] steps = sort.Steps;
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

        /// <summary>
        /// Makes the next draw the only one that counts: Unity keeps a draw until the frame ends, also where its camera is rendered
        /// once more before, as for the sides of a cube.
        /// </summary>
        void Count()
        {
            int now = frame == Time.frameCount ? number[0] + 1 : 0;
            frame = Time.frameCount;
            if (now == number[0]) return;
            number[0] = now;
            latest.SetData(number);
        }

        /// <summary>Asks Unity for the draw. space: of the splats to the world; rule: whose blending; indices: two triangles a splat.</summary>
        public void Draw(Camera camera, GsacFinish finish, GsacData rule, Matrix4x4 space, GraphicsBuffer splats, GraphicsBuffer colours,
                         GraphicsBuffer indices, int count, GsacSort sort, Bounds bounds)
        {
            Count();
            properties.SetInteger(NumberId, number[0]);
            properties.SetBuffer(LatestId, latest);
            for (int r = 0; r < 3; r++) properties.SetVector(ModelIds[r], space.GetRow(r));
            bool linear = QualitySettings.activeColorSpace == ColorSpace.Linear;
            bool own = linear && finish.Trained && GsacPicture.IsPossible;
            properties.SetVector(BlendId, new Vector4(rule.LowPass, rule.AlphaMax, rule.AlphaMin, linear && !own ? 1 : 0));
            properties.SetInteger(KeepsEnergyId, rule.KeepsEnergy ? 1 : 0);
            properties.SetVector(TintId, finish.Tint);
            properties.SetInteger(FogId, finish.Fog ? 1 : 0);
            properties.SetInteger(IndexBitsId, sort.IndexBits);
            properties.SetBuffer(SplatsId, splats);
            properties.SetBuffer(ColoursId, colours);
            properties.SetBuffer(KeysId, keys);
            var draw = new RenderParams(own ? GsacCameras.TrainedMaterial : finish.Material)
            {
                camera = camera, worldBounds = bounds, matProps = properties, layer = finish.Layer,
                shadowCastingMode = ShadowCastingMode.Off, receiveShadows = false,
            };
            if (own) picture.Draw(camera, bounds, properties, indices, count * 6);
            // the picture is two triangles
            Graphics.RenderPrimitivesIndexed(draw, MeshTopology.Triangles, indices, own ? 6 : count * 6);
        }
    }
}
