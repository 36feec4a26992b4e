using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>What a click in the scene view meets and what the key F frames: balls about the bones, unseen.</summary>
    public static class GsacSceneBounds
    {
        const float Thinnest = 0.06f; // m
        const float AtEnd = 0.12f;    // m: crown, fingertips, toes

        [DrawGizmo(GizmoType.Pickable | GizmoType.NonSelected | GizmoType.Selected)]
        static void Draw(GsacAvatar avatar, GizmoType type)
        {
            if (!avatar.CanOpen) return;
            Transform[] joints = Joints(avatar);
            if (joints == null) return;
            Gizmos.color = new Color(0, 0, 0, 0);
            for (int j = 0; j < joints.Length; j++)
            {
                Vector3 centre;
                float radius = Ball(joints, avatar.Data, j, out centre);
                Gizmos.DrawSphere(centre, radius);
            }
        }

        /// <summary>The person as she stands, in the world; without extent where there is no usable file.</summary>
        public static Bounds Of(GsacAvatar avatar)
        {
            Transform[] joints = Joints(avatar);
            if (joints == null) return new Bounds(avatar.transform.position, Vector3.zero);
            Vector3 least = avatar.transform.position, most = least;
            for (int j = 0; j < joints.Length; j++)
            {
                Vector3 centre;
                float radius = Ball(joints, avatar.Data, j, out centre);
                var half = new Vector3(radius, radius, radius);
                least = Vector3.Min(least, centre - half);
                most = Vector3.Max(most, centre + half);
            }
            return new Bounds((least + most) * 0.5f, most - least);
        }

        static Transform[] Joints(GsacAvatar avatar)
        {
            try
            {
                return avatar.Joints;
            }
            catch (GsacException)
            {
                return null; // the renderer has said it
            }
        }

        /// <summary>The ball over a bone, at the last joints of a chain about the joint; its radius, m.</summary>
        static float Ball(Transform[] joints, GsacData data, int j, out Vector3 centre)
        {
            float size = joints[0].lossyScale.x;
            centre = joints[j].position;
            if (joints[j].childCount == 0) return AtEnd * size;
            Vector3 from = j == 0 ? centre : joints[data.Parents[j]].position;
            float radius = System.Math.Max(Thinnest * size, Vector3.Distance(centre, from) * 0.5f);
            centre = (centre + from) * 0.5f;
            return radius;
        }
    }
}
