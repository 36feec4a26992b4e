using System;
using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>Tells which part of the person a fingertip touches, and has her smile while it does.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Touch")]
    [DefaultExecutionOrder(9700)]
    public sealed class GsacTouch : MonoBehaviour
    {
        static readonly string[] Smile = { "mouthSmileLeft", "mouthSmileRight" };

        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("Who knows the fingertips: a component with IGsacHands.")] MonoBehaviour hands = null;
        [SerializeField, Tooltip("m: about a bone; fingers are thinner.")] float radius = 0.09f;
        [SerializeField, Tooltip("s: time constant of the smile")] float smoothing = 0.2f;

        readonly string[] touched = new string[2];
        float smile;

        /// <summary>Left or right hand, and SMPL-X's name of the joint, when a touch begins.</summary>
        public event Action<bool, string> Touched;

        /// <summary>The joint that a hand touches now; null for none.</summary>
        public string TouchedBy(bool left)
        {
            return touched[left ? 0 : 1];
        }

        void LateUpdate()
        {
            GsacAvatar person = cast == null ? null : cast.First;
            var tracked = hands as IGsacHands;
            if (person == null || tracked == null) return;
            bool any = false;
            for (int side = 0; side < 2; side++)
            {
                Vector3 tip;
                string now = tracked.TryTip(side == 0, out tip) ? JointAt(person, tip) : null;
                if (now != null && touched[side] == null && Touched != null) Touched(side == 0, now);
                touched[side] = now;
                any |= now != null;
            }
            if (!any && smile == 0) return;
            smile += ((any ? 1 : 0) - smile) * (smoothing <= 0 ? 1 : 1 - Mathf.Exp(-Time.deltaTime / smoothing));
            if (!any && smile < 0.01f) smile = 0;
            foreach (string name in Smile)
            {
                if (Array.IndexOf(person.Data.Expressions, name) >= 0) person.SetExpression(name, smile);
            }
        }

        /// <summary>The joint on whose bone, to its parent, the place lies; null where it lies on none.</summary>
        string JointAt(GsacAvatar person, Vector3 place)
        {
            Transform[] joints = person.Joints;
            float size = person.transform.lossyScale.x, nearest = 1;
            string found = null;
            for (int j = 1; j < joints.Length; j++)
            {
                Vector3 to = joints[j].position, from = joints[person.Data.Parents[j]].position;
                // a bone is as thick as `radius`, but not thicker than half its length
                float thick = Math.Max(0.02f * size, Math.Min(radius * size, Vector3.Distance(from, to) / 2));
                float away = Distance(place, from, to) / thick;
                if (away >= nearest) continue;
                nearest = away;
                found = person.Data.JointNames[j];
            }
            return found;
        }

        /// <summary>Of a place from a line's piece.</summary>
        static float Distance(Vector3 place, Vector3 from, Vector3 to)
        {
            Vector3 along = to - from, beside = place - from;
            float length2 = along.x * along.x + along.y * along.y + along.z * along.z;
            float share = length2 == 0 ? 0 : (along.x * beside.x + along.y * beside.y + along.z * beside.z) / length2;
            return Vector3.Distance(place, from + along * Mathf.Clamp(share, 0, 1));
        }
    }
}
