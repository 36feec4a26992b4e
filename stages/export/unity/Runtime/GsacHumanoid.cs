using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>A Mecanim Avatar for the skeleton, so that any Humanoid clip plays.</summary>
    public static class GsacHumanoid
    {
        /// <summary>SMPL-X joint, Unity's human bone.</summary>
        static readonly string[,] Body =
        {
            { "pelvis", "Hips" }, { "spine1", "Spine" }, { "spine2", "Chest" }, { "spine3", "UpperChest" }, { "neck", "Neck" },
            { "head", "Head" }, { "jaw", "Jaw" }, { "left_eye_smplhf", "LeftEye" }, { "right_eye_smplhf", "RightEye" },
        };

        static readonly string[,] Limbs =
        {
            { "hip", "UpperLeg" }, { "knee", "LowerLeg" }, { "ankle", "Foot" }, { "foot", "Toes" }, { "collar", "Shoulder" },
            { "shoulder", "UpperArm" }, { "elbow", "LowerArm" }, { "wrist", "Hand" },
        };

        static readonly string[,] Fingers =
        {
            { "thumb", "Thumb" }, { "index", "Index" }, { "middle", "Middle" }, { "ring", "Ring" }, { "pinky", "Little" },
        };

        static readonly string[] Phalanges = { "Proximal", "Intermediate", "Distal" };

        /// <summary>Unity's human bone of each joint, null where it has none.</summary>
        public static string[] HumanNames(string[] jointNames)
        {
            var known = new Dictionary<string, string>();
            for (int i = 0; i < Body.GetLength(0); i++) known[Body[i, 0]] = Body[i, 1];
            foreach (string side in new[] { "Left", "Right" })
            {
                string low = side.ToLowerInvariant() + "_";
                for (int i = 0; i < Limbs.GetLength(0); i++) known[low + Limbs[i, 0]] = side + Limbs[i, 1];
                for (int i = 0; i < Fingers.GetLength(0); i++)
                {
                    for (int k = 0; k < 3; k++) known[low + Fingers[i, 0] + (k + 1)] = side + " " + Fingers[i, 1] + " " + Phalanges[k];
                }
            }
            var names = new string[jointNames.Length];
            for (int j = 0; j < names.Length; j++) known.TryGetValue(jointNames[j], out names[j]);
            return names;
        }

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
            string[] names = HumanNames(data.JointNames);
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
