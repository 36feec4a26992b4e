using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>
    /// The avatar's own picture for one camera, composited in display colours as it was trained, which GsacTrained.shader lays over
    /// the scene. Only as large as the avatar on the screen; of a headset with a part for each eye, side by side.
    /// </summary>
    public sealed class GsacPicture : IDisposable
    {
        const int Spare = 64; // px that a new picture has more than it needs; it is kept until four times that are too many
        static readonly int ViewId = Shader.PropertyToID("GsacEyeView");
        static readonly int ProjectionId = Shader.PropertyToID("GsacEyeProjection");
        static readonly int ScreenId = Shader.PropertyToID("GsacEyeScreen");
        static readonly int RectId = Shader.PropertyToID("GsacEyeRect");
        static readonly int LensId = Shader.PropertyToID("GsacEyeLens");
        static readonly int PlaceId = Shader.PropertyToID("GsacEyePlace");
        static readonly int PartsId = Shader.PropertyToID("GsacParts");
        static readonly int ColourId = Shader.PropertyToID("GsacTrained");
        static readonly int DepthId = Shader.PropertyToID("GsacTrainedDepth");
        static readonly int CopiedId = Shader.PropertyToID("GsacBehindIsCopied");

        readonly GsacEyes eyes = new GsacEyes();
        readonly int[] left = new int[GsacEyes.Most], low = new int[GsacEyes.Most]; // px of the screen, of each eye's part
        readonly Vector4[] rects = new Vector4[GsacEyes.Most], lenses = new Vector4[GsacEyes.Most], places = new Vector4[GsacEyes.Most];
        readonly RenderTargetIdentifier[] targets = new RenderTargetIdentifier[2];
        int parts; // eyes that the picture is made for
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
            eyes.Take(camera);
            float width = eyes.Width, height = eyes.Height;
            int wide = 0, high = 0;
            for (int e = 0; e < eyes.Count; e++)
            {
                Vector4 rect = Rect(eyes.Lenses[e] * eyes.Views[e], bounds);
                // whole pixels of the screen
                left[e] = (int)Math.Floor((rect.x + 1) / 2 * width);
                low[e] = (int)Math.Floor((rect.y + 1) / 2 * height);
                wide = Math.Max(wide, (int)Math.Ceiling((rect.z + 1) / 2 * width) - left[e]);
                high = Math.Max(high, (int)Math.Ceiling((rect.w + 1) / 2 * height) - low[e]);
            }
            if (colour == null || parts != eyes.Count || !Fits(colour.width / parts, wide) || !Fits(colour.height, high))
                Resize(wide + Spare, high + Spare);
            wide = colour.width / parts;
            high = colour.height;

            float near = camera.nearClipPlane, far = camera.farClipPlane;
            float away = -eyes.Views[0].MultiplyPoint3x4(bounds.center).z;
            away = Math.Min(Math.Max(away, near + 0.01f * (far - near)), near + 0.99f * (far - near));
            bool whole = camera.rect.width == 1 && camera.rect.height == 1; // a part of a screen has no copy of its own
            properties.SetVector(ScreenId, new Vector4(wide, high, away, whole ? 1 : 0));
            for (int e = 0; e < parts; e++)
            {
                rects[e] = new Vector4(2 * left[e] / width - 1, 2 * low[e] / height - 1,
                                       2 * (left[e] + wide) / width - 1, 2 * (low[e] + high) / height - 1);
                Look(e);
                DrawEye(e, wide, properties, quads, indexCount);
            }
            if (parts == 1) places[1] = places[0]; // never the nearer one
            properties.SetVectorArray(PlaceId, places);
            properties.SetVectorArray(RectId, rects);
            properties.SetVectorArray(LensId, lenses);
            properties.SetInteger(PartsId, parts);
            properties.SetTexture(ColourId, colour);
            properties.SetTexture(DepthId, depth);
            properties.SetInteger(CopiedId, GsacCameras.CopiesBehind != null && GsacCameras.CopiesBehind(camera) ? 1 : 0);
        }

        /// <summary>Fills an eye's `places` and `lenses`.</summary>
        void Look(int eye)
        {
            Vector3 place = eyes.Place(eye);
            Matrix4x4 lens = eyes.Lenses[eye];
            bool flat = lens.m33 > 0.5f;
            places[eye] = new Vector4(place.x, place.y, place.z, 0);
            lenses[eye] = new Vector4(lens.m00, lens.m11, flat ? -lens.m03 : lens.m02, flat ? -lens.m13 : lens.m12);
        }

        /// <summary>Draws an eye's part of the picture, at once: the next eye's takes the same properties.</summary>
        void DrawEye(int eye, int wide, MaterialPropertyBlock properties, GraphicsBuffer quads, int indexCount)
        {
            properties.SetMatrix(ViewId, eyes.Views[eye]);
            properties.SetMatrix(ProjectionId, GL.GetGPUProjectionMatrix(Crop(rects[eye]) * eyes.Lenses[eye], true));
            commands.Clear();
            commands.SetRenderTarget(targets, targets[0]);
            if (eye == 0) commands.ClearRenderTarget(false, true, Color.clear);
            commands.SetViewport(new Rect(eye * wide, 0, wide, colour.height));
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

        /// <summary>width, height: px of an eye's part.</summary>
        void Resize(int width, int height)
        {
            Free();
            parts = eyes.Count;
            width *= parts;
            if (commands == null) commands = new CommandBuffer { name = "Gsac" };
            // Linear: what the shader writes is kept as it is
            colour = new RenderTexture(width, height, 0, RenderTextureFormat.ARGBHalf, RenderTextureReadWrite.Linear) { hideFlags = HideFlags.HideAndDontSave };
            depth = new RenderTexture(width, height, 0, RenderTextureFormat.RHalf, RenderTextureReadWrite.Linear) { hideFlags = HideFlags.HideAndDontSave };
            targets[0] = new RenderTargetIdentifier(colour);
            targets[1] = new RenderTargetIdentifier(depth);
        }
    }
}
