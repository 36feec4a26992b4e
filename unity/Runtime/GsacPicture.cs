using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>
    /// The avatar's own picture for one camera, composited in display colours as it was trained, which GsacTrained.shader lays over
    /// the scene. Only as large as the avatar on the screen.
    /// </summary>
    public sealed class GsacPicture : IDisposable
    {
        const int Spare = 64; // px that a new picture has more than it needs; it is kept until four times that are too many
        static readonly int ViewId = Shader.PropertyToID("GsacEyeView");
        static readonly int ProjectionId = Shader.PropertyToID("GsacEyeProjection");
        static readonly int ScreenId = Shader.PropertyToID("GsacEyeScreen");
        static readonly int RectId = Shader.PropertyToID("GsacEyeRect");
        static readonly int LensId = Shader.PropertyToID("GsacEyeLens");
        static readonly int ColourId = Shader.PropertyToID("GsacTrained");
        static readonly int DepthId = Shader.PropertyToID("GsacTrainedDepth");
        static readonly int CopiedId = Shader.PropertyToID("GsacBehindIsCopied");

        readonly RenderTargetIdentifier[] targets = new RenderTargetIdentifier[2];
        RenderTexture colour, depth;
        CommandBuffer commands;

        /// <summary>Whether this device can draw one.</summary>
        public static bool IsPossible
        {
            get
            {
                return SystemInfo.supportedRenderTargetCount >= 2 && SystemInfo.SupportsRenderTextureFormat(RenderTextureFormat.ARGBHalf)
                    && SystemInfo.SupportsRenderTextureFormat(RenderTextureFormat.RHalf);
            }
        }

        public void Dispose()
        {
            if (commands != null) commands.Release();
            commands = null;
            Free();
        }

        void Free()
        {
            GsacCameras.Free(colour);
            GsacCameras.Free(depth);
            colour = depth = null;
        }

        /// <summary>
        /// Draws the sorted splats, before the camera does, and gives `properties` what the picture is laid over the scene with.
        /// bounds: of the avatar in the world; properties: those of the splats.
        /// </summary>
        public void Draw(Camera camera, Bounds bounds, MaterialPropertyBlock properties, GraphicsBuffer quads, int indexCount)
        {
            Matrix4x4 view = camera.worldToCameraMatrix, lens = camera.projectionMatrix;
            float width = camera.pixelWidth, height = camera.pixelHeight;
            Vector4 rect = Rect(lens * view, bounds);
            // whole pixels of the screen
            int left = (int)Math.Floor((rect.x + 1) / 2 * width), low = (int)Math.Floor((rect.y + 1) / 2 * height);
            int wide = (int)Math.Ceiling((rect.z + 1) / 2 * width) - left, high = (int)Math.Ceiling((rect.w + 1) / 2 * height) - low;
            if (colour == null || !Fits(colour.width, wide) || !Fits(colour.height, high)) Resize(wide + Spare, high + Spare);
            wide = colour.width;
            high = colour.height;
            rect = new Vector4(2 * left / width - 1, 2 * low / height - 1, 2 * (left + wide) / width - 1, 2 * (low + high) / height - 1);

            bool flat = lens.m33 > 0.5f;
            float near = camera.nearClipPlane, far = camera.farClipPlane;
            float away = Math.Min(Math.Max(-view.MultiplyPoint3x4(bounds.center).z, near + 0.01f * (far - near)), near + 0.99f * (far - near));
            bool whole = camera.rect.width == 1 && camera.rect.height == 1; // a part of a screen has no copy of its own
            properties.SetMatrix(ViewId, view);
            properties.SetMatrix(ProjectionId, GL.GetGPUProjectionMatrix(Crop(rect) * lens, true));
            properties.SetVector(ScreenId, new Vector4(wide, high, away, whole ? 1 : 0));
            properties.SetVector(RectId, rect);
            properties.SetVector(LensId, new Vector4(lens.m00, lens.m11, flat ? -lens.m03 : lens.m02, flat ? -lens.m13 : lens.m12));
            properties.SetTexture(ColourId, colour);
            properties.SetTexture(DepthId, depth);
            properties.SetInteger(CopiedId, GsacCameras.CopiesBehind != null && GsacCameras.CopiesBehind(camera) ? 1 : 0);

            commands.Clear();
            commands.SetRenderTarget(targets, targets[0]);
            commands.ClearRenderTarget(false, true, Color.clear);
            commands.DrawProcedural(quads, Matrix4x4.identity, GsacCameras.OwnMaterial, 0, MeshTopology.Triangles, indexCount, 1, properties);
            Graphics.ExecuteCommandBuffer(commands);
        }

        static bool Fits(int size, int need)
        {
            return size >= need && size <= need + 4 * Spare;
        }

        /// <summary>Clip x and y of the lower left and the upper right corner of where the avatar lies on the screen.</summary>
        static Vector4 Rect(Matrix4x4 toClip, Bounds bounds)
        {
            var rect = new Vector4(1, 1, -1, -1);
            Vector4 x = toClip.GetRow(0), y = toClip.GetRow(1), w = toClip.GetRow(3);
            for (int i = 0; i < 8; i++)
            {
                var side = new Vector3((i & 1) - 0.5f, (i >> 1 & 1) - 0.5f, (i >> 2) - 0.5f);
                Vector3 p = bounds.center + new Vector3(side.x * bounds.size.x, side.y * bounds.size.y, side.z * bounds.size.z);
                float ahead = At(w, p);
                // a corner behind the eye may lie anywhere
                if (ahead < 1e-3f) return new Vector4(-1, -1, 1, 1);
                float right = Mathf.Clamp(At(x, p) / ahead, -1, 1), up = Mathf.Clamp(At(y, p) / ahead, -1, 1);
                rect = new Vector4(Math.Min(rect.x, right), Math.Min(rect.y, up), Math.Max(rect.z, right), Math.Max(rect.w, up));
            }
            return rect;
        }

        static float At(Vector4 row, Vector3 p)
        {
            return row.x * p.x + row.y * p.y + row.z * p.z + row.w;
        }

        /// <summary>From a camera's clip space to that of the rectangle alone.</summary>
        static Matrix4x4 Crop(Vector4 rect)
        {
            float x = 2 / (rect.z - rect.x), y = 2 / (rect.w - rect.y);
            Matrix4x4 crop = Matrix4x4.identity;
            crop.m00 = x;
            crop.m03 = -x * (rect.x + rect.z) / 2;
            crop.m11 = y;
            crop.m13 = -y * (rect.y + rect.w) / 2;
            return crop;
        }

        void Resize(int width, int height)
        {
            Free();
            if (commands == null) commands = new CommandBuffer { name = "Gsac" };
            // Linear: what the shader writes is kept as it is
            colour = new RenderTexture(width, height, 0, RenderTextureFormat.ARGBHalf, RenderTextureReadWrite.Linear) { hideFlags = HideFlags.HideAndDontSave };
            depth = new RenderTexture(width, height, 0, RenderTextureFormat.RHalf, RenderTextureReadWrite.Linear) { hideFlags = HideFlags.HideAndDontSave };
            targets[0] = new RenderTargetIdentifier(colour);
            targets[1] = new RenderTargetIdentifier(depth);
        }
    }
}
