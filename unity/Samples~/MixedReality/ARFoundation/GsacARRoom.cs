using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR.ARFoundation;
using UnityEngine.XR.ARSubsystems;

namespace Gsac.Samples
{
    /// <summary>
    /// The room by AR Foundation: headsets and phones of several makers. Depth of headsets, by AR Shader Occlusion (from 6.1 on); on phones AR
    /// Camera Background writes it by itself where an AR Occlusion Manager is on the camera.
    /// </summary>
    [AddComponentMenu("Gsac/Samples/Gsac AR Room")]
    public sealed class GsacARRoom : MonoBehaviour, IGsacRoom
    {
        static readonly int TextureId = Shader.PropertyToID("_EnvironmentDepthTexture");
        static readonly int MatricesId = Shader.PropertyToID("_EnvironmentDepthProjectionMatrices");
        static readonly int MetresId = Shader.PropertyToID("_NdcLinearConversionParameters");

        [SerializeField, Tooltip("On the camera; it shows the room.")] ARCameraManager seen = null;
        [SerializeField, Tooltip("Knows the planes.")] ARRaycastManager planes = null;
        [SerializeField, Tooltip("On the camera, with AR Shader Occlusion beside it.")] AROcclusionManager measured = null;
        [SerializeField, Tooltip("What the headset's places are measured from: Camera Offset of the XR Origin; the world where this is empty.")] Transform origin = null;

        readonly List<Matrix4x4> matrices = new List<Matrix4x4>();
        readonly List<ARRaycastHit> hits = new List<ARRaycastHit>();

        public void ShowRoom(bool shown)
        {
            if (seen != null) seen.enabled = shown;
            if (measured != null) measured.enabled = shown;
        }

        public bool TryDepth(GsacRoomDepth depth)
        {
            if (measured == null || !measured.enabled) return false;
            depth.Texture = Shader.GetGlobalTexture(TextureId);
            Shader.GetGlobalMatrixArray(MatricesId, matrices);
            if (depth.Texture == null || matrices.Count == 0) return false;
            Matrix4x4 toOrigin = origin == null ? Matrix4x4.identity : origin.worldToLocalMatrix;
            for (int side = 0; side < 2; side++) depth.FromWorld[side] = matrices[side < matrices.Count ? side : 0] * toOrigin;
            depth.Metres = Shader.GetGlobalVector(MetresId);
            return true;
        }

        public bool TryFloor(Vector3 from, Vector3 ahead, out Vector3 place)
        {
            place = from;
            if (planes == null || !planes.Raycast(new Ray(from, ahead), hits, TrackableType.PlaneWithinPolygon) || hits.Count == 0) return false;
            // the nearest comes first; tables are met before the floor
            place = hits[hits.Count - 1].pose.position;
            return true;
        }
    }
}
