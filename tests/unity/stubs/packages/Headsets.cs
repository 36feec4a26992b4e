// Stands for what samples take from packages of headsets and phones: com.unity.xr.arfoundation 5, com.unity.xr.arkit 5,
// com.unity.xr.hands 1.3, com.meta.xr.sdk.core 71. Written from their manuals; none of them was there to be compared with.
using System;
using System.Collections;
using System.Collections.Generic;
using UnityEngine;

namespace Unity.Collections
{
    public enum Allocator { Temp = 2 }

    public struct NativeArray<T> : IDisposable where T : struct
    {
        T[] all;
        public NativeArray(T[] array, Allocator allocator) { all = array; }
        public int Length { get { return all.Length; } }
        public T this[int index] { get { return all[index]; } }
        public void Dispose() { }
    }
}

namespace UnityEngine.XR.ARSubsystems
{
    public struct TrackableId { }
    [Flags] public enum TrackableType { PlaneWithinPolygon = 1 }
    public class XRFaceSubsystem { }
}

namespace UnityEngine.XR.ARKit
{
    using Unity.Collections;
    using UnityEngine.XR.ARSubsystems;

    public enum ARKitBlendShapeLocation { BrowInnerUp = 3, JawOpen = 29 }

    public struct ARKitBlendShapeCoefficient
    {
        public ARKitBlendShapeLocation blendShapeLocation { get; set; }
        public float coefficient { get; set; }
    }

    public sealed class ARKitFaceSubsystem : XRFaceSubsystem
    {
        public ARKitBlendShapeCoefficient[] Seen;
        public NativeArray<ARKitBlendShapeCoefficient> GetBlendShapeCoefficients(TrackableId faceId, Allocator allocator)
        {
            return new NativeArray<ARKitBlendShapeCoefficient>(Seen, allocator);
        }
    }
}

namespace UnityEngine.XR.ARFoundation
{
    using UnityEngine.XR.ARSubsystems;

    public sealed class ARFace : MonoBehaviour { public TrackableId trackableId { get; set; } }

    public struct TrackableCollection<T> : IEnumerable<T>
    {
        public List<T> All;
        IEnumerator<T> IEnumerable<T>.GetEnumerator() { return All.GetEnumerator(); }
        IEnumerator IEnumerable.GetEnumerator() { return All.GetEnumerator(); }
    }

    public sealed class ARFaceManager : MonoBehaviour
    {
        public XRFaceSubsystem subsystem { get; set; }
        public TrackableCollection<ARFace> trackables { get; set; }
    }

    public sealed class ARCameraManager : MonoBehaviour { }
    public sealed class AROcclusionManager : MonoBehaviour { }

    public struct ARRaycastHit { public Pose pose { get; set; } }

    public sealed class ARRaycastManager : MonoBehaviour
    {
        public readonly List<ARRaycastHit> Met = new List<ARRaycastHit>();
        public bool Raycast(Ray ray, List<ARRaycastHit> hitResults, TrackableType trackableTypes)
        {
            hitResults.Clear();
            hitResults.AddRange(Met);
            return Met.Count > 0;
        }
    }
}

namespace UnityEngine.XR.Hands
{
    public enum XRHandJointID { IndexTip = 11 }

    public struct XRHandJoint
    {
        public Vector3 Place;
        public bool TryGetPose(out Pose pose)
        {
            pose = new Pose { position = Place };
            return true;
        }
    }

    public struct XRHand
    {
        public Vector3 Place;
        public bool isTracked { get; set; }
        public XRHandJoint GetJoint(XRHandJointID id) { return new XRHandJoint { Place = Place }; }
    }

    public sealed class XRHandSubsystem
    {
        public XRHand leftHand { get; set; }
        public XRHand rightHand { get; set; }
    }
}

public sealed class OVRPassthroughLayer : MonoBehaviour { public bool hidden; }

namespace Meta.XR.EnvironmentDepth
{
    public sealed class EnvironmentDepthManager : MonoBehaviour
    {
        public static bool IsSupported { get { return true; } }
        public bool IsDepthAvailable { get; set; }
    }
}
