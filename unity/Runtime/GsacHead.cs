using UnityEngine;
using UnityEngine.XR;

namespace Gsac
{
    /// <summary>Moves a camera with the headset, by Unity's own XR input; also just before the frame is drawn. Needs no package.</summary>
    [AddComponentMenu("Gsac/Gsac Head")]
    public sealed class GsacHead : MonoBehaviour
    {
        [SerializeField, Tooltip("m: of the eyes over the floor while no headset is there.")] float usual = 1.6f;

        void OnEnable()
        {
            Application.onBeforeRender += Follow;
        }

        void OnDisable()
        {
            Application.onBeforeRender -= Follow;
        }

        void Update()
        {
            Follow();
        }

        void Follow()
        {
            InputDevice head = InputDevices.GetDeviceAtXRNode(XRNode.CenterEye);
            Vector3 place;
            Quaternion turn;
            bool tracked = head.TryGetFeatureValue(CommonUsages.centerEyePosition, out place);
            transform.localPosition = tracked ? place : new Vector3(0, usual, 0);
            if (head.TryGetFeatureValue(CommonUsages.centerEyeRotation, out turn)) transform.localRotation = turn;
        }
    }
}
