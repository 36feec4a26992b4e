using System.Collections.Generic;
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

        /// <summary>Null where one is missing.</summary>
        public static Transform[] Find(GsacData data, Transform root)
        {
            var byName = new Dictionary<string, Transform>();
            foreach (Transform t in root.GetComponentsInChildren<Transform>(true))
            {
                if (t != root) byName[t.name] = t;
            }
            var joints = new Transform[data.JointCount];
            for (int j = 0; j < joints.Length; j++)
            {
                if (!byName.TryGetValue(data.JointNames[j], out joints[j])) return null;
            }
            return joints;
        }

        static Transform[] Build(GsacData data, Transform root)
        {
            var joints = new Transform[data.JointCount];
            for (int j = 0; j < joints.Length; j++)
            {
                joints[j] = new GameObject(data.JointNames[j]).transform;
                joints[j].SetParent(j == 0 ? root : joints[data.Parents[j]], false);
                joints[j].localPosition = j == 0 ? RootPlace(data) : Place(data, j) - Place(data, data.Parents[j]);
            }
            return joints;
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
            float[] r = pose.Rotation;
            for (int j = 0; j < joints.Length; j++)
            {
                joints[j].localRotation = new Quaternion(r[j * 4], r[j * 4 + 1], r[j * 4 + 2], r[j * 4 + 3]);
            }
            joints[0].localPosition = RootPlace(data) + new Vector3(pose.Transl[0], pose.Transl[1], pose.Transl[2]);
        }

        public static void Read(GsacPose pose, GsacData data, Transform[] joints)
        {
            for (int j = 0; j < joints.Length; j++)
            {
                Quaternion q = joints[j].localRotation;
                pose.Rotation[j * 4] = q.x;
                pose.Rotation[j * 4 + 1] = q.y;
                pose.Rotation[j * 4 + 2] = q.z;
                pose.Rotation[j * 4 + 3] = q.w;
            }
            Vector3 moved = joints[0].localPosition - RootPlace(data);
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
