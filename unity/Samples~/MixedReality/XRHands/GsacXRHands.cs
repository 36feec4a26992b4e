using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR.Hands;

namespace Gsac.Samples
{
    /// <summary>Fingertips of tracked hands, by the package XR Hands.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac XR Hands")]
    public sealed class GsacXRHands : MonoBehaviour, IGsacHands
    {
        [SerializeField, Tooltip("What the headset's places are measured from; the world where this is empty.")] Transform origin = null;

        readonly List<XRHandSubsystem> systems = new List<XRHandSubsystem>();

        public bool TryTip(bool left, out Vector3 tip)
        {
            tip = Vector3.zero;
            if (systems.Count == 0) SubsystemManager.GetSubsystems(systems);
            if (systems.Count == 0) return false;
            XRHand hand = left ? systems[0].leftHand : systems[0].rightHand;
            Pose pose;
            if (!hand.isTracked || !hand.GetJoint(XRHandJointID.IndexTip).TryGetPose(out pose)) return false;
            tip = origin == null ? pose.position : origin.localToWorldMatrix.MultiplyPoint3x4(pose.position);
            return true;
        }
    }
}
