using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>A Mecanim Avatar for the skeleton, so that any Humanoid clip plays.</summary>
    public static class GsacHumanoid
    {
        /// <summary>The joints must stand in the T-pose. The Avatar says by isValid and isHuman whether Unity takes it.</summary>
        public static Avatar Build(GsacData data, GameObject root, Transform[] joints)
        {
            // Unity wants the root on top of the hierarchy, and at rest
            Transform top = root.transform, parent = top.parent;
            int place = top.GetSiblingIndex();
            Vector3 position = top.localPosition, scale = top.localScale;
            Quaternion rotation = top.localRotation;
            if (parent != null) top.SetParent(null, false);
            Rest(top, Vector3.zero, Quaternion.identity, new Vector3(1, 1, 1));
            Avatar avatar = AvatarBuilder.BuildHumanAvatar(root, Describe(data, top, joints));
            avatar.name = "Humanoid";
            if (parent != null)
            {
                top.SetParent(parent, false);
                top.SetSiblingIndex(place);
            }
            Rest(top, position, rotation, scale);
            return avatar;
        }

        static void Rest(Transform t, Vector3 position, Quaternion rotation, Vector3 scale)
        {
            t.localPosition = position;
            t.localRotation = rotation;
            t.localScale = scale;
        }

        static HumanDescription Describe(GsacData data, Transform root, Transform[] joints)
        {
            string[] names = GsacHumanBones.Names(data.JointNames);
            var human = new List<HumanBone>();
            var skeleton = new List<SkeletonBone> { Bone(root) };
            for (int j = 0; j < joints.Length; j++)
            {
                skeleton.Add(Bone(joints[j]));
                if (names[j] == null) continue;
                var bone = new HumanBone { boneName = joints[j].name, humanName = names[j] };
                bone.limit.useDefaultValues = true;
                human.Add(bone);
            }
            return new HumanDescription
            {
                human = human.ToArray(), skeleton = skeleton.ToArray(), upperArmTwist = 0.5f, lowerArmTwist = 0.5f, upperLegTwist = 0.5f,
                lowerLegTwist = 0.5f, armStretch = 0.05f, legStretch = 0.05f, feetSpacing = 0, hasTranslationDoF = false,
            };
        }

        static SkeletonBone Bone(Transform t)
        {
            return new SkeletonBone { name = t.name, position = t.localPosition, rotation = t.localRotation, scale = t.localScale };
        }
    }
}
