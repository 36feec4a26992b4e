// Stands for cameras that are rendered by hand, what they render to, and the choice of the render pipeline. API.md: pages and versions.
using System;

namespace UnityEngine
{
    using UnityEngine.Rendering;

    public enum CameraClearFlags { Skybox = 1, SolidColor = 2 }

    public sealed partial class Camera
    {
        public CameraClearFlags clearFlags { get; set; }
        public Color backgroundColor { get; set; }
        public bool allowHDR { get; set; }
        public bool allowMSAA { get; set; }
        public float nearClipPlane { get; set; } = 0.01f;
        public float farClipPlane { get; set; } = 1000;
        public float fieldOfView { get; set; }
        public bool orthographic { get; set; }
        public float orthographicSize { get; set; }
        public RenderTexture targetTexture { get; set; }
    }

    public sealed class RenderTexture : Texture
    {
        /// <summary>Not Unity's: lowest row first.</summary>
        public Color32[] Pixels;
        public int width { get; private set; }
        public int height { get; private set; }
        public static RenderTexture active { get; set; }
        public RenderTexture(int width, int height, int depth)
        {
            this.width = width;
            this.height = height;
            Pixels = new Color32[width * height];
        }
        public RenderTexture(int width, int height, int depth, RenderTextureFormat format, RenderTextureReadWrite readWrite)
        {
            if (width <= 0 || height <= 0) throw new ArgumentException("a picture of " + width + " x " + height);
            this.width = width;
            this.height = height;
            Made.Add(this);
        }
    }

    public static class ScreenCapture
    {
        public enum StereoScreenCaptureMode { BothEyes = 3 }
        public static Texture2D CaptureScreenshotAsTexture(StereoScreenCaptureMode stereoCaptureMode) { return Player.OnCapture(); }
    }

    public static partial class QualitySettings
    {
        public static RenderPipelineAsset renderPipeline { get; set; }
    }

    public sealed class WaitForEndOfFrame
    {
    }
}

namespace UnityEngine.Rendering
{
    public class RenderPipelineAsset : ScriptableObject
    {
    }

    public static class GraphicsSettings
    {
        public static RenderPipelineAsset defaultRenderPipeline { get; set; }
        public static RenderPipelineAsset currentRenderPipeline { get { return QualitySettings.renderPipeline ?? defaultRenderPipeline; } }
    }
}

namespace UnityEngine.XR
{
    public static class XRSettings
    {
        public enum StereoRenderingMode { MultiPass, SinglePass, SinglePassInstanced, SinglePassMultiview }
        public static int eyeTextureWidth { get { return 1200; } }
        public static int eyeTextureHeight { get; internal set; } = 1080;
        public static StereoRenderingMode stereoRenderingMode { get { return StereoRenderingMode.SinglePassInstanced; } }
    }
}
