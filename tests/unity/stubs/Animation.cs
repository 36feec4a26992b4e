// Stands for Unity's clips and human poses. Clips hold their curves and move blend shapes and turns; muscles are made up. API.md: pages and versions.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public struct Keyframe
    {
        public float time { get; set; }
        public float value { get; set; }
        public float inTangent { get; set; }
        public float outTangent { get; set; }
        public Keyframe(float time, float value, float inTangent, float outTangent) : this()
        {
            this.time = time;
            this.value = value;
            this.inTangent = inTangent;
            this.outTangent = outTangent;
        }
    }

    public sealed class AnimationCurve
    {
        public Keyframe[] keys { get; private set; }
        public AnimationCurve(params Keyframe[] keys) { this.keys = keys; }

        // Hermite's, as Unity's curves are
        public float Evaluate(float time)
        {
            int k = 0;
            while (k + 2 < keys.Length && keys[k + 1].time <= time) k++;
            if (keys.Length == 1) return keys[0].value;
            Keyframe a = keys[k], b = keys[k + 1];
            float span = b.time - a.time, t = Math.Min(Math.Max((time - a.time) / span, 0), 1), u = 1 - t;
            return (1 + 2 * t) * u * u * a.value + t * u * u * span * a.outTangent + t * t * (3 - 2 * t) * b.value - t * t * u * span * b.inTangent;
        }
    }

    public class Motion : Object { }

    public sealed class AnimationClip : Motion
    {
        internal readonly Dictionary<string, AnimationCurve> Curves = new Dictionary<string, AnimationCurve>();
        public float frameRate { get; set; }
        public void SetCurve(string relativePath, Type type, string propertyName, AnimationCurve curve)
        {
            Curves.Add(relativePath + ": " + type.Name + "." + propertyName, curve);
        }
        public void SampleAnimation(GameObject go, float time)
        {
            foreach (KeyValuePair<string, AnimationCurve> pair in Curves)
            {
                string[] words = pair.Key.Split(new[] { ": ", "." }, 3, StringSplitOptions.None);
                Transform at = go.transform;
                foreach (string name in words[0].Split(new[] { '/' }, StringSplitOptions.RemoveEmptyEntries)) at = at.Children.Find(child => child.name == name);
                if (words[1] != "SkinnedMeshRenderer" || !words[2].StartsWith("blendShape.")) throw new NotImplementedException(pair.Key);
                var renderer = at.GetComponent<SkinnedMeshRenderer>();
                renderer.SetBlendShapeWeight(renderer.sharedMesh.GetBlendShapeIndex(words[2].Substring("blendShape.".Length)), pair.Value.Evaluate(time));
            }
        }
    }

    public struct HumanPose
    {
        public Vector3 bodyPosition;
        public Quaternion bodyRotation;
        public float[] muscles;
    }

    public sealed class HumanPoseHandler : IDisposable
    {
        readonly Transform root;
        public HumanPoseHandler(Avatar avatar, Transform root) { this.root = root; }

        // the place and turn of the first bone; muscle i is the sine of half the turn of bone i mod 55
        public void GetHumanPose(ref HumanPose humanPose)
        {
            var bones = new List<Transform>();
            Collect(root.Children[0], bones);
            humanPose.bodyPosition = bones[0].localPosition;
            Quaternion q = bones[0].localRotation;
            humanPose.bodyRotation = Player.Heads-- % 2 == 0 ? q : new Quaternion(-q.x, -q.y, -q.z, -q.w);
            humanPose.muscles = new float[HumanTrait.MuscleCount];
            for (int i = 0; i < humanPose.muscles.Length; i++)
            {
                Quaternion turn = bones[i % bones.Count].localRotation;
                humanPose.muscles[i] = Mathf.Sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z);
            }
        }

        static void Collect(Transform from, List<Transform> bones)
        {
            bones.Add(from);
            foreach (Transform child in from.Children) Collect(child, bones);
        }

        public void Dispose() { }
    }

    public static class HumanTrait
    {
        public static int MuscleCount { get { return MuscleName.Length; } }
        public static string[] MuscleName { get; } = Names();
        static string[] Names()
        {
            var names = new List<string>();
            foreach (string bone in new[] { "Spine", "Chest", "UpperChest" })
            {
                names.AddRange(new[] { bone + " Front-Back", bone + " Left-Right", bone + " Twist Left-Right" });
            }
            foreach (string bone in new[] { "Neck", "Head" })
            {
                names.AddRange(new[] { bone + " Nod Down-Up", bone + " Tilt Left-Right", bone + " Turn Left-Right" });
            }
            names.AddRange(new[] { "Left Eye Down-Up", "Left Eye In-Out", "Right Eye Down-Up", "Right Eye In-Out", "Jaw Close", "Jaw Left-Right" });
            foreach (string muscle in new[] { "Upper Leg Front-Back", "Upper Leg In-Out", "Upper Leg Twist In-Out", "Lower Leg Stretch",
                                              "Lower Leg Twist In-Out", "Foot Up-Down", "Foot Twist In-Out", "Toes Up-Down" }) names.Add("Left " + muscle);
            foreach (string left in names.GetRange(21, 8)) names.Add(left.Replace("Left ", "Right "));
            foreach (string muscle in new[] { "Shoulder Down-Up", "Shoulder Front-Back", "Arm Down-Up", "Arm Front-Back", "Arm Twist In-Out", "Forearm Stretch",
                                              "Forearm Twist In-Out", "Hand Down-Up", "Hand In-Out" }) names.Add("Left " + muscle);
            foreach (string left in names.GetRange(37, 9)) names.Add(left.Replace("Left ", "Right "));
            foreach (string side in new[] { "Left ", "Right " })
            {
                foreach (string finger in new[] { "Thumb", "Index", "Middle", "Ring", "Little" })
                {
                    foreach (string muscle in new[] { " 1 Stretched", " Spread", " 2 Stretched", " 3 Stretched" }) names.Add(side + finger + muscle);
                }
            }
            return names.ToArray();
        }
    }
}

namespace UnityEngine.Events
{
    public delegate void UnityAction();

    public class UnityEvent
    {
        event UnityAction Called;
        public void AddListener(UnityAction call) { Called += call; }
        public void Invoke() { if (Called != null) Called(); }
    }
}
