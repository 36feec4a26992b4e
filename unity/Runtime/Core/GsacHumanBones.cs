using System.Collections.Generic;

namespace Gsac
{
    /// <summary>Which of Unity's human bones each SMPL-X joint is, and of which part of the person.</summary>
    public static class GsacHumanBones
    {
        static readonly string[,] Body =
        {
            { "pelvis", "Hips" }, { "spine1", "Spine" }, { "spine2", "Chest" }, { "spine3", "UpperChest" }, { "neck", "Neck" },
            { "head", "Head" },
        };

        static readonly string[,] Face = { { "jaw", "Jaw" }, { "left_eye_smplhf", "LeftEye" }, { "right_eye_smplhf", "RightEye" } };

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

        /// <summary>The bone of each joint as HumanTrait spells it ("Left Index Proximal"), null where it has none.</summary>
        public static string[] Names(string[] jointNames)
        {
            var known = new Dictionary<string, string>();
            for (int i = 0; i < Body.GetLength(0); i++) known[Body[i, 0]] = Body[i, 1];
            for (int i = 0; i < Face.GetLength(0); i++) known[Face[i, 0]] = Face[i, 1];
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

        /// <summary>The part that each joint belongs to: jaw and eyes are the face, fingers the hands, all else the body.</summary>
        public static GsacParts[] Parts(string[] jointNames)
        {
            string[] human = Names(jointNames);
            var parts = new GsacParts[human.Length];
            for (int j = 0; j < parts.Length; j++)
            {
                parts[j] = GsacParts.Body;
                for (int i = 0; i < Face.GetLength(0); i++)
                {
                    if (human[j] == Face[i, 1]) parts[j] = GsacParts.Face;
                }
                foreach (string phalanx in Phalanges)
                {
                    bool finger = human[j] != null && human[j].EndsWith(" " + phalanx, System.StringComparison.Ordinal);
                    if (finger) parts[j] = GsacParts.Hands;
                }
            }
            return parts;
        }
    }
}
