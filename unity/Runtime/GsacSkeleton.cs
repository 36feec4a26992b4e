using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>The avatar's joints as transforms: SMPL-X's names, identity rotations at rest (T-pose), feet at y = 0.</summary>
    public static class GsacSkeleton
    {
        /// <summary>The joints below `root`, made where they are not there.</summary>
        public static Transform[] Joints(GsacData data, Transform root)
        {
            return Find(data, root) ?? Build(data, root);
        }

        /// <summary>
        /// Null where one is missing. A joint is the child of its parent: what else hangs below the person, another person too, may
        /// be called as it likes.
        /// </summary>
        public static Transform[] Find(GsacData data, Transform root)
        {
            var joints = new Transform[data.JointCount];
            for (int j = 0; j < joints.Length; j++)
            {
                Transform parent = j == 0 ? root : joints[data.Parents[j]];
                joints[j] = Child(parent, data.JointNames[j]);
                if (joints[j] == null) return null;
            }
            return joints;
        }

        /// <summary>The first child of a name; null where there is none.</summary>
        static Transform Child(Transform parent, string name)
        {
            for (int i = 0; i < parent.childCount; i++)
            {
                if (parent.GetChild(i).name == name) return parent.GetChild(i);
            }
            return null;
        }

        /// <summary>Takes joints away; what else hung on them then hangs on the root, where it was in the world.</summary>
        public static void Remove(Transform root, Transform[] joints)
        {
            foreach (Transform joint in joints)
            {
                for (int i = joint.childCount - 1; i >= 0; i--)
                {
                    Transform child = joint.GetChild(i);
                    if (Array.IndexOf(joints, child) < 0) child.SetParent(root, true);
                }
            }
            joints[0].SetParent(null, false); // destroyed only at the frame's end
            UnityEngine.Object.Destroy(joints[0].gameObject);
        }

        public static Transform[] Build(GsacData data, Transform root)
        {
            var joints = new Transform[data.JointCount];
            for (int j = 0; j < joints.Length; j++)
            {
                joints[j] = new GameObject(data.JointNames[j]).transform;
                joints[j].SetParent(j == 0 ? root : joints[data.Parents[j]], false);
            }
            Rest(data, joints);
            return joints;
        }

        /// <summary>Puts joints into the T-pose of a file.</summary>
        public static void Rest(GsacData data, Transform[] joints)
        {
            for (int j = 0; j < joints.Length; j++)
            {
                joints[j].localPosition = j == 0 ? RootPlace(data) : Place(data, j) - Place(data, data.Parents[j]);
                joints[j].localRotation = Quaternion.identity;
                joints[j].localScale = new Vector3(1, 1, 1);
            }
        }

        public static Vector3 Place(GsacData data, int joint)
        {
            return new Vector3(data.Joints[joint * 3], data.Joints[joint * 3 + 1], data.Joints[joint * 3 + 2]);
        }

        /// <summary>Local position of joint 0 in the T-pose, the floor at 0.</summary>
        public static Vector3 RootPlace(GsacData data)
        {
            return Place(data, 0) - new Vector3(0, data.Ground, 0);
        }

        public static void Apply(GsacPose pose, GsacData data, Transform[] joints)
        {
            for (int j = 0; j < joints.Length; j++) ApplyTurn(pose, j, joints[j]);
            ApplyTransl(pose, data, joints[0]);
        }

        public static void ApplyTurn(GsacPose pose, int joint, Transform transform)
        {
            float[] r = pose.Rotation;
            int o = joint * 4;
            transform.localRotation = new Quaternion(r[o], r[o + 1], r[o + 2], r[o + 3]);
        }

        public static void ApplyTransl(GsacPose pose, GsacData data, Transform root)
        {
            root.localPosition = RootPlace(data) + new Vector3(pose.Transl[0], pose.Transl[1], pose.Transl[2]);
        }

        public static void Read(GsacPose pose, GsacData data, Transform[] joints)
        {
            for (int j = 0; j < joints.Length; j++) ReadTurn(pose, j, joints[j]);
            ReadTransl(pose, data, joints[0]);
        }

        public static void ReadTurn(GsacPose pose, int joint, Transform transform)
        {
            Quaternion q = transform.localRotation;
            int o = joint * 4;
            pose.Rotation[o] = q.x;
            pose.Rotation[o + 1] = q.y;
            pose.Rotation[o + 2] = q.z;
            pose.Rotation[o + 3] = q.w;
        }

        public static void ReadTransl(GsacPose pose, GsacData data, Transform root)
        {
            Vector3 moved = root.localPosition - RootPlace(data);
            pose.Transl[0] = moved.x;
            pose.Transl[1] = moved.y;
            pose.Transl[2] = moved.z;
        }

        /// <summary>Where the rows of `Bones` put a joint, in the space of their root.</summary>
        public static Vector3 Posed(GsacData data, Vector4[] rows, int joint)
        {
            float x = data.Joints[joint * 3], y = data.Joints[joint * 3 + 1], z = data.Joints[joint * 3 + 2];
            Vector4 r0 = rows[joint * 3], r1 = rows[joint * 3 + 1], r2 = rows[joint * 3 + 2];
            return new Vector3(r0.x * x + r0.y * y + r0.z * z + r0.w, r1.x * x + r1.y * y + r1.z * z + r1.w,
                               r2.x * x + r2.y * y + r2.z * z + r2.w);
        }

        /// <summary>Rows of rest -> posed, J x 3, in the space of `root`.</summary>
        public static void Bones(GsacData data, Transform root, Transform[] joints, Vector4[] rows)
        {
            Matrix4x4 toRoot = root.worldToLocalMatrix;
            for (int j = 0; j < joints.Length; j++)
            {
                Matrix4x4 m = toRoot * joints[j].localToWorldMatrix;
                float x = data.Joints[j * 3], y = data.Joints[j * 3 + 1], z = data.Joints[j * 3 + 2];
                rows[j * 3] = new Vector4(m.m00, m.m01, m.m02, m.m03 - (m.m00 * x + m.m01 * y + m.m02 * z));
                rows[j * 3 + 1] = new Vector4(m.m10, m.m11, m.m12, m.m13 - (m.m10 * x + m.m11 * y + m.m12 * z));
                rows[j * 3 + 2] = new Vector4(m.m20, m.m21, m.m22, m.m23 - (m.m20 * x + m.m21 * y + m.m22 * z));
            }
        }
    }
}
