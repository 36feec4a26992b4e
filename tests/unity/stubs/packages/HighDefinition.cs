// Stands for what the package takes from com.unity.render-pipelines.high-definition 12 to 17, compared with its published source.
using System.Collections.Generic;

namespace UnityEngine.Rendering.HighDefinition
{
    public sealed class HDRenderPipeline : RenderPipeline { }

    public enum FrameSettingsField { Refraction = 13 }

    public struct FrameSettings
    {
        internal bool Refracts;
        public bool IsEnabled(FrameSettingsField field) { return Refracts; }
    }

    public sealed class HDCamera
    {
        static readonly Dictionary<Camera, HDCamera> All = new Dictionary<Camera, HDCamera>();
        public FrameSettings frameSettings { get; private set; }

        /// <summary>Not Unity's: what the camera's frame settings say.</summary>
        public void SetRefraction(bool there) { frameSettings = new FrameSettings { Refracts = there }; }

        public static HDCamera GetOrCreate(Camera camera, int xrMultipassId = 0)
        {
            HDCamera found;
            if (!All.TryGetValue(camera, out found)) All[camera] = found = new HDCamera();
            return found;
        }
    }
}
