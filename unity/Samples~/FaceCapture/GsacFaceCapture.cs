using System;
using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>
    /// Puts a tracked face on a person, over whatever moves the body. The tracker is a component on the same object; without one another
    /// character's face is copied, whose blend shapes have ARKit's names.
    /// </summary>
    [AddComponentMenu("Gsac/Samples/Gsac Face Capture")]
    [DefaultExecutionOrder(8000)]
    public sealed class GsacFaceCapture : MonoBehaviour
    {
        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("Whose face is copied where there is no tracker.")] SkinnedMeshRenderer other = null;
        [SerializeField, Tooltip("s: time constant; also of the way back when the face is lost.")] float smoothing = 0.05f;

        IGsacFace tracker;
        GsacAvatar avatar;
        string[] names;
        float[] incoming, shown;
        int[] shapes;

        void Start()
        {
            avatar = cast == null ? null : cast.First;
            if (avatar == null) return;
            tracker = GetComponent<IGsacFace>();
            names = avatar.Data.Expressions;
            incoming = new float[names.Length];
            shown = new float[names.Length];
            if (other != null) shapes = Array.ConvertAll(names, name => other.sharedMesh.GetBlendShapeIndex(name));
        }

        void LateUpdate()
        {
            if (avatar == null) return;
            if (!Read()) Array.Clear(incoming, 0, incoming.Length);
            float step = smoothing <= 0 ? 1 : 1 - Mathf.Exp(-Time.deltaTime / smoothing);
            for (int e = 0; e < names.Length; e++)
            {
                shown[e] += (Mathf.Clamp(incoming[e], 0, 1) - shown[e]) * step;
                avatar.SetExpression(names[e], shown[e]);
            }
        }

        bool Read()
        {
            if (tracker != null) return tracker.TryRead(names, incoming);
            if (shapes == null) return false;
            for (int e = 0; e < names.Length; e++) incoming[e] = shapes[e] < 0 ? 0 : other.GetBlendShapeWeight(shapes[e]) / 100;
            return true;
        }
    }
}
