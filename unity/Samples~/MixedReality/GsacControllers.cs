using UnityEngine;
using UnityEngine.XR;

namespace Gsac.Samples
{
    /// <summary>Fingertips where only controllers are there: a little before each, by Unity's own XR input.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Controllers")]
    public sealed class GsacControllers : MonoBehaviour, IGsacHands
    {
        [SerializeField, Tooltip("What the headset's places are measured from; the world where this is empty.")] Transform origin = null;
        [SerializeField, Tooltip("m: of the tip before the controller")] float ahead = 0.08f;

        public bool TryTip(bool left, out Vector3 tip)
        {
            InputDevice hand = InputDevices.GetDeviceAtXRNode(left ? XRNode.LeftHand : XRNode.RightHand);
            Quaternion turn = Quaternion.identity;
            if (!hand.TryGetFeatureValue(CommonUsages.devicePosition, out tip) || !hand.TryGetFeatureValue(CommonUsages.deviceRotation, out turn)) return false;
            tip += turn * Vector3.forward * ahead;
            if (origin != null) tip = origin.localToWorldMatrix.MultiplyPoint3x4(tip);
            return true;
        }
    }
}
