using System.Collections.Generic;
using Meta.XR.EnvironmentDepth;
using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>The room as a Quest knows it, by the Meta XR Core SDK: passthrough and measured depth.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Meta Room")]
    public sealed class GsacMetaRoom : MonoBehaviour, IGsacRoom
    {
        static readonly int TextureId = Shader.PropertyToID("_EnvironmentDepthTexture");
        static readonly int MatricesId = Shader.PropertyToID("_EnvironmentDepthReprojectionMatrices");
        static readonly int MetresId = Shader.PropertyToID("_EnvironmentDepthZBufferParams");

        [SerializeField] OVRPassthroughLayer layer = null;
        [SerializeField] EnvironmentDepthManager measured = null;

        readonly List<Matrix4x4> matrices = new List<Matrix4x4>();

        public void ShowRoom(bool shown)
        {
            if (layer != null) layer.hidden = !shown;
            if (measured != null) measured.enabled = shown && EnvironmentDepthManager.IsSupported;
        }

        public bool TryDepth(GsacRoomDepth depth)
        {
            if (measured == null || !measured.enabled || !measured.IsDepthAvailable) return false;
            depth.Texture = Shader.GetGlobalTexture(TextureId);
            Shader.GetGlobalMatrixArray(MatricesId, matrices);
            if (depth.Texture == null || matrices.Count < 2) return false;
            for (int side = 0; side < 2; side++) depth.FromWorld[side] = matrices[side];
            depth.Metres = Shader.GetGlobalVector(MetresId);
            return true;
        }

        public bool TryFloor(Vector3 from, Vector3 ahead, out Vector3 place)
        {
            // with the tracking origin on the floor level it is where the world is 0
            place = from;
            return false;
        }
    }
}
