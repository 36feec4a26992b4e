using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR.ARFoundation;
using UnityEngine.XR.ARSubsystems;

namespace Gsac.Samples
{
    /// <summary>The room by AR Foundation: headsets and phones of several makers. Its depth has no common form yet and is not used.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac AR Room")]
    public sealed class GsacARRoom : MonoBehaviour, IGsacRoom
    {
        [SerializeField, Tooltip("On the camera; it shows the room.")] ARCameraManager seen = null;
        [SerializeField, Tooltip("Knows the planes.")] ARRaycastManager planes = null;

        readonly List<ARRaycastHit> hits = new List<ARRaycastHit>();

        public void ShowRoom(bool shown)
        {
            if (seen != null) seen.enabled = shown;
        }

        public bool TryDepth(GsacRoomDepth depth)
        {
            return false;
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
