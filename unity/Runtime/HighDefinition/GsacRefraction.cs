using UnityEngine;
using UnityEngine.Rendering;
using UnityEngine.Rendering.HighDefinition;

namespace Gsac
{
    /// <summary>Tells the avatars for which cameras HDRP copies what lies behind the transparent things: where their frame settings have Refraction.</summary>
    public static class GsacRefraction
    {
        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.SubsystemRegistration)]
        public static void Tell()
        {
            GsacCameras.CopiesBehind = Copies;
        }

        static bool Copies(Camera camera)
        {
            // of the frame before: HDRP settles this one's after its cameras have begun
            return RenderPipelineManager.currentPipeline is HDRenderPipeline
                && HDCamera.GetOrCreate(camera).frameSettings.IsEnabled(FrameSettingsField.Refraction);
        }
    }
}
