using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Gives the person a capsule collider for each part of the body while the game plays; they move with the joints. A collider's object is
    /// a child of the joint that it goes with.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Colliders")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(9500)]
    [RequireComponent(typeof(GsacAvatar))]
    public sealed class GsacColliders : MonoBehaviour
    {
        const string Name = "Gsac Collider";

        [SerializeField, Tooltip("Whether they only tell of touches and hold nothing up.")] bool triggers = true;

        readonly List<CapsuleCollider> capsules = new List<CapsuleCollider>();
        GsacAvatar avatar;
        GsacModel fitted;

        /// <summary>Whether they only tell of touches and hold nothing up.</summary>
        public bool Triggers
        {
            get { return triggers; }
            set
            {
                triggers = value;
                foreach (CapsuleCollider capsule in capsules) capsule.isTrigger = value;
            }
        }

        /// <summary>SMPL-X's name of the joint that a collider goes with; null where it is none of these.</summary>
        public static string JointOf(Collider collider)
        {
            return collider != null && collider.name == Name ? collider.transform.parent.name : null;
        }

        void LateUpdate()
        {
            if (avatar == null) avatar = GetComponent<GsacAvatar>();
            // another person may be in this one's place
            if (!avatar.IsOpen || ReferenceEquals(avatar.Model, fitted)) return;
            Clear();
            Fit();
        }

        void OnDisable()
        {
            Clear();
        }

        void Clear()
        {
            foreach (CapsuleCollider capsule in capsules)
            {
                if (capsule != null) Destroy(capsule.gameObject);
            }
            capsules.Clear();
            fitted = null;
        }

        void Fit()
        {
            fitted = avatar.Model;
            foreach (GsacCapsule part in GsacCapsules.Fit(fitted.Data))
            {
                var holder = new GameObject(Name) { layer = gameObject.layer, hideFlags = HideFlags.DontSave };
                holder.transform.SetParent(avatar.Joints[part.Joint], false);
                // joints have no turn of their own at rest
                holder.transform.localPosition = Vector(part.Centre) - GsacSkeleton.Place(fitted.Data, part.Joint);
                holder.transform.localRotation = Quaternion.FromToRotation(new Vector3(0, 1, 0), Vector(part.Along));
                var capsule = holder.AddComponent<CapsuleCollider>();
                capsule.radius = (float)part.Radius;
                capsule.height = 2 * (float)(part.Half + part.Radius);
                capsule.isTrigger = triggers;
                capsules.Add(capsule);
            }
        }

        static Vector3 Vector(double[] a)
        {
            return new Vector3((float)a[0], (float)a[1], (float)a[2]);
        }
    }
}
