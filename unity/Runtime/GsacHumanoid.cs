using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>A Mecanim Avatar for the skeleton, so that any Humanoid clip plays.</summary>
    public static class GsacHumanoid
    {
        /// <summary>
        /// Of a skeleton of its own in the T-pose, so that it matters neither how the person stands nor what else hangs on the joints.
        /// The Avatar says by isValid and isHuman whether Unity takes it.
        /// </summary>
        public static Avatar Build(GsacData data, string name)
        {
            var root = new GameObject(name) { hideFlags = HideFlags.HideAndDontSave };
            Transform[] joints = GsacSkeleton.Build(data, root.transform);
            Avatar avatar = AvatarBuilder.BuildHumanAvatar(root, Describe(data, root.transform, joints));
            avatar.name = "Humanoid";
            UnityEngine.Object.DestroyImmediate(root);
            return avatar;
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
