using System;
using System.Collections.Generic;
using Unity.Collections;
using UnityEngine;
using UnityEngine.XR.ARFoundation;
using UnityEngine.XR.ARKit;

namespace Gsac.Samples
{
    /// <summary>The face that an iPhone sees, by AR Foundation and ARKit.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac ARKit Face")]
    public sealed class GsacARKitFace : MonoBehaviour, IGsacFace
    {
        [SerializeField] ARFaceManager manager = null;

        Dictionary<ARKitBlendShapeLocation, int> places;

        public bool TryRead(string[] names, float[] weights)
        {
            var system = manager == null ? null : manager.subsystem as ARKitFaceSubsystem;
            if (system == null) return false;
            if (places == null) places = Places(names);
            foreach (ARFace face in manager.trackables)
            {
                using (NativeArray<ARKitBlendShapeCoefficient> found = system.GetBlendShapeCoefficients(face.trackableId, Allocator.Temp))
                {
                    for (int i = 0; i < found.Length; i++)
                    {
                        int e;
                        if (places.TryGetValue(found[i].blendShapeLocation, out e)) weights[e] = found[i].coefficient;
                    }
                }
                return true;
            }
            return false;
        }

        /// <summary>Unity writes `EyeBlinkLeft` for ARKit's `eyeBlinkLeft`.</summary>
        static Dictionary<ARKitBlendShapeLocation, int> Places(string[] names)
        {
            var places = new Dictionary<ARKitBlendShapeLocation, int>();
            for (int e = 0; e < names.Length; e++)
            {
                ARKitBlendShapeLocation place;
                if (Enum.TryParse(names[e], true, out place)) places[place] = e;
            }
            return places;
        }
    }
}
